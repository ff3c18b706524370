# docker build -t care-sim . && docker run care-sim
FROM python:3.13-slim
WORKDIR /care-sim
COPY LICENSE README.md constraints.txt pyproject.toml requirements-pybullet.txt ./
COPY care_sim care_sim
RUN pip install --no-cache-dir --no-deps --requirement requirements-pybullet.txt
RUN pip install --no-cache-dir --constraint constraints.txt .
RUN useradd --create-home user
USER user
WORKDIR /home/user
ENTRYPOINT ["care-sim"]
CMD ["reproduce"]

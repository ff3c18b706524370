"""An mkdocs hook: the notebook is run while the site is built, and is a page of it with what came
out.
"""

from base64 import b64decode
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient
from traitlets.config import Config

NOTEBOOK = "quickstart"
_TIMEOUT_S = 600
"""For a cell; the first one compiles on a machine that has not done so yet."""
_FIGURES = """
import matplotlib
for part in ("figure.facecolor", "axes.facecolor"):
    matplotlib.rcParams[part] = "none"
for part in ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"):
    matplotlib.rcParams[part] = "0.5"
"""
"""Runs before the first cell and is not shown: figures for white grounds and for dark ones."""


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """The files of the site, with the notebook's page and pictures."""
    book = nbformat.read(Path(config.docs_dir) / f"{NOTEBOOK}.ipynb", as_version=4)
    book.cells.insert(0, nbformat.v4.new_code_cell(_FIGURES))
    with TemporaryDirectory() as folder:
        # Over TCP the kernel warns that everybody on the machine may listen. Sockets whose place is
        # not named lie in the working folder, where two sites that are built at once share them.
        private = Config({"KernelManager": {"transport": "ipc", "ip": f"{folder}/kernel"}})
        NotebookClient(book, timeout=_TIMEOUT_S, kernel_name="python3", config=private).execute()
    parts: list[str] = []
    for cell in book.cells[1:]:
        parts.append(
            cell.source if cell.cell_type == "markdown" else _fenced("python", cell.source)
        )
        for output in cell.get("outputs", []):
            picture = output.get("data", {}).get("image/png")
            if picture:
                name = f"{NOTEBOOK}-{len(parts)}.png"
                files.append(File.generated(config, name, content=b64decode(picture)))
                parts.append(f"![What the code above draws]({name})")
            else:
                parts.append(_fenced("text", output.get("text") or output["data"]["text/plain"]))
    files.append(File.generated(config, f"{NOTEBOOK}.md", content="\n\n".join(parts)))
    return files


def _fenced(language: str, text: str) -> str:
    return f"```{language}\n{text.rstrip()}\n```"

"""`care-sim certify`: whether this machine plays a list of episodes as it was published.

What is played is in `design`, what of it is hashed in `trail`, and how the published trails in
`published.parquet` are read in `published`.
"""

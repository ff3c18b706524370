"""A folder of results as one web page that needs nothing else: tables, charts, episodes, where they
come from.
"""

"""A folder of results as one web page that needs nothing else: tables, figures, episodes, and where
they come from.
"""

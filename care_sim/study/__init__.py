"""Studies: episodes by the hundred, one tidy row each; tables and figures are pure functions of
rows.
"""

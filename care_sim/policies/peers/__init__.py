"""Published allocators of others, rebuilt from their papers: one idea per file, with its
differences.
"""

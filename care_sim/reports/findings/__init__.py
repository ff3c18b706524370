"""What a study showed, in plain words: at every budget who leads, and whether a control does as
well.
"""

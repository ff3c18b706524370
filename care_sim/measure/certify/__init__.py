"""`care-sim certify`: whether this machine plays a published list of episodes as they were
played.
"""

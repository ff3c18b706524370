"""Campaigns of random input: every command, call and file, kills, interrupts and full disks.

A campaign is a module with `play(case)`, which does one thing that a user, or bad luck, could do,
and raises `Fault` where the answer is wrong. A case is named CAMPAIGN:SEED:NUMBER and is the same
every time; `make torture CASE=...` plays one alone and shows all of it. The suite plays a few of
each, `make torture SECONDS=600 SEED=1` as many as fit.
"""

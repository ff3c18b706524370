"""Policies that nobody should mistake for contenders: they show what a number may hang on."""

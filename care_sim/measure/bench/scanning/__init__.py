"""Casters of rays beside each other."""

"""Allocators that others published, rebuilt from their texts: an idea a file, with what differs."""

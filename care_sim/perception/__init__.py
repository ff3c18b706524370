"""Detectors and track memory."""

"""Procedural single poses."""

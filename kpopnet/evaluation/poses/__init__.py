"""Evaluation of joints against true joints."""

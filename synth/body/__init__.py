"""Simulated people: body shapes, motion-capture markers, collision capsules."""

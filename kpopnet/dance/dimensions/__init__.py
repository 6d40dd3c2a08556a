"""What the similarity of a dance does not contain: the stage, dynamics, rhythm."""

"""Sets of dances with a teacher and ranked learners, in the K-Pop folder format (docs/kpop_format.md)."""

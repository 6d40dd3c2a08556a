"""The programs: the only modules that know both kpopnet, which reads depth, and synth, which makes it."""

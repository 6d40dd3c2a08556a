"""What is wrong with a dance, moment by moment and phrase by phrase, in words."""

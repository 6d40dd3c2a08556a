"""The vocabulary of dance: moves of the feet, of the arms, and of the whole body, written in the language of `moves`."""

from synth.motion.vocabulary.lower import LOWER
from synth.motion.vocabulary.upper import UPPER
from synth.motion.vocabulary.whole import WHOLE

__all__ = ["LOWER", "UPPER", "WHOLE"]

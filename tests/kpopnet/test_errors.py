"""The exception for invalid input."""

import pickle

from kpopnet.errors import InputError


def test_a_message_is_one_line_that_can_be_printed() -> None:
    assert str(InputError("a.csv: column 'x\ny\r' and \ud800")) == "a.csv: column 'x\\ny\\r' and \\ud800"
    assert str(InputError("a.csv: \x1b[31m\x9b2J \u202e\u2028, 카이")) == "a.csv: \\x1b[31m\\x9b2J \\u202e\\u2028, 카이"


def test_an_error_of_a_worker_process_reaches_its_parent() -> None:
    error = pickle.loads(pickle.dumps(InputError("a.csv: two\nlines")))
    assert isinstance(error, InputError) and str(error) == "a.csv: two\\nlines"

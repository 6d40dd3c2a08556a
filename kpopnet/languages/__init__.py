"""What a dancer reads, in their language, for the pages and the programs alike.

English is the source: its texts stand in the code, and as keys in the catalogues of the other languages, ko.mjs and de.mjs.
Numbers and names fill gaps such as {degrees}. Where one English text needs several translations, a word before "|" tells them
apart.
"""

import json
import re
from functools import cache
from importlib.resources import files
from typing import Any

LANGUAGES = ("en", "ko", "de")
DECIMAL_COMMA = ("de",)

_GAP, _CONTEXT, _DECIMAL = re.compile(r"\{(\w+)\}"), re.compile(r"^\w+\|"), re.compile(r"[+-]?\d+\.\d+")


class Said(str):
    """A text in English that knows how it was made, so that it can be said in another language.

    Attributes:
        template: the text with gaps.
        values: what fills them: `Said`, text that stays as it is, or lists of them.
    """

    template: str
    values: dict[str, Any]

    def __new__(cls, template: str, /, **values: Any) -> "Said":
        said = super().__new__(cls, _filled(template, values, "en"))
        said.template, said.values = template, values
        return said

    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]:  # for copies, and for other processes
        return (self.template,), self.values


def in_language(text: str, language: str) -> str:
    """A text of the catalogue in one of LANGUAGES; any other text as it is."""
    if isinstance(text, Said):
        return _filled(text.template, text.values, language)
    return catalogue(language).get(text, text)


def keyed(content: Any) -> Any:
    """Nested dicts and lists for a page, which words each `Said` itself: {"say": its template, and its values}."""
    if isinstance(content, Said):
        return {"say": content.template} | {name: keyed(value) for name, value in content.values.items()}
    if isinstance(content, dict):
        return {name: keyed(value) for name, value in content.items()}
    return [keyed(one) for one in content] if isinstance(content, list | tuple) else content


@cache
def catalogue(language: str) -> dict[str, str]:
    """English texts to those of one of LANGUAGES; none for English itself."""
    if language == "en":
        return {}
    text = (files("kpopnet.languages") / f"{language}.mjs").read_text(encoding="utf-8")
    return json.loads(text.removeprefix("export default ").rstrip().removesuffix(";"))


def _filled(template: str, values: dict[str, Any], language: str) -> str:
    text = catalogue(language).get(template) or _CONTEXT.sub("", template)
    return _GAP.sub(lambda gap: _shown(values[gap[1]], language), text)


def _shown(value: Any, language: str) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(_shown(one, language) for one in value)
    if isinstance(value, Said):
        return in_language(value, language)
    comma = language in DECIMAL_COMMA and _DECIMAL.fullmatch(str(value))
    return str(value).replace(".", ",") if comma else str(value)

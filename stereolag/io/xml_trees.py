"""XML as OpenCV's FileStorage writes it, from untrusted bytes: no entities, no type definitions, bounded depth."""

from __future__ import annotations

import io
from typing import Any
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import iterparse

MAX_DEPTH = 16
MAX_ELEMENTS = 20_000

_ITEM = "_"
"""OpenCV's name for the elements of a sequence."""


def parse_xml(data: bytes, what: str) -> Any:
    """Return the content of the root element as text, lists and dictionaries.

    Raises
    ------
    ValueError
        Not XML, a type definition or an entity, or more than 16 levels or 20,000 elements.
    """
    try:
        return _tree(_root(data, what))
    except DefusedXmlException as error:
        raise ValueError(
            f"The {what} (XML) defines types or entities, which are not accepted; save it as OpenCV does, without them."
        ) from error
    except ParseError as error:
        line = error.position[0]
        raise ValueError(f"The {what} cannot be parsed as XML: it is broken or cut short at line {line}.") from error
    except (LookupError, UnicodeError) as error:
        raise ValueError(f"The {what} (XML) is in an encoding that is not known; save it in UTF-8.") from error


def _root(data: bytes, what: str) -> Element:
    """Return the root; too deep a nesting is refused before the text is read to its end."""
    depth = elements = 0
    root: Element | None = None
    for happened, element in iterparse(io.BytesIO(data), events=("start", "end"), forbid_dtd=True):
        if happened == "end":
            depth -= 1
            continue
        root = element if root is None else root
        depth, elements = depth + 1, elements + 1
        if depth > MAX_DEPTH:
            raise ValueError(f"The {what} (XML) is nested more than {MAX_DEPTH} levels deep.")
        if elements > MAX_ELEMENTS:
            raise ValueError(f"The {what} (XML) holds more than {MAX_ELEMENTS:,} elements.")
    assert root is not None
    return root


def _tree(element: Element) -> Any:
    children = list(element)
    if not children:
        return (element.text or "").strip().strip('"')
    if all(child.tag == _ITEM for child in children):
        return [_tree(child) for child in children]
    return {child.tag: _tree(child) for child in children}

"""Plain words: what a machine can see of the style that CONTRIBUTING.md asks of every text."""

import ast
import io
import re
import tokenize

import pytest

from tests.helpers.places import PAGES, ROOT, name_of

OPENINGS = {"Of", "Who", "Whoever", "What", "That", "Those", "Whatever", "Whose"}
"""A sentence that begins with one of these hides its subject."""
PHRASES = re.compile(
    r"\b(is told|are told|asks for|hangs on|of before|(?<!dead )(?<!dead-)reckon\w*)\b", re.I
)
LONGEST = 30
"""Words of a sentence."""
MODULES = sorted((ROOT / "care_sim").rglob("*.py"))
PROGRAMS = [*MODULES, *(path for name in ("docs", "tests") for path in (ROOT / name).rglob("*.py"))]
ITEM = re.compile(r"\n\s*(?:[-*#|>]|\d+\. |\n|!\[)")
"""List items, table rows, headings, quotations, pictures and paragraphs are texts of their own."""


def sentences(text):
    for part in ITEM.split(f"\n{text}"):
        # A stop before a small letter ends no sentence: "e.g. one".
        yield from re.split(r"(?<=[.!?])[)\"'*_`]*\s+(?=[^a-z\s])", part)


def long_sentences(text):
    for sentence in sentences(text):
        words = [word for word in sentence.split() if re.search(r"\w", word)]
        if len(words) > LONGEST:
            yield f"{len(words)} words: {' '.join(words[:8])} ..."


def phrases(text):
    yield from (f"'{found[0]}'" for found in PHRASES.finditer(" ".join(text.split())))


def openings(text):
    """Yield the faults of sentences; questions may begin so, and "That is why" within a text."""
    hiding = OPENINGS
    for words in filter(None, map(str.split, sentences(text))):
        if words[0] in hiding and not words[-1].endswith("?"):
            yield f"begins with {words[0]}: {' '.join(words[:8])}"
        hiding = OPENINGS - {"That"}


def is_docstring(node):
    """Return whether a node is the docstring of a module, class or function, or a string behind an
    attribute.
    """
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def inverted(source):
    """Yield (line, fault) of the docstrings and comments of a program."""
    # Few programs hold such a word at all, and reading comments takes long.
    if any(word in source for word in OPENINGS):
        docstrings = filter(is_docstring, ast.walk(ast.parse(source)))
        texts = ((node.lineno, node.value.value) for node in docstrings)
        for line, text in (*texts, *comments(source)):
            for found in openings(text):
                yield line, found


def module_faults(source):
    """Yield (line, fault) of the docstrings, comments and other strings of a module."""
    for node in ast.walk(ast.parse(source)):
        if is_docstring(node):
            for found in long_sentences(node.value.value):
                yield node.lineno, found
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            for found in phrases(node.value):
                yield node.lineno, found
    for line, block in comments(source):
        for found in phrases(block):
            yield line, found


def comments(source):
    """Yield (line, text) of comments; lines that follow each other are one."""
    line, text, last = 0, "", -1
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT:
            continue
        if token.start[0] == last + 1:
            text = f"{text} {token.string.lstrip('#')}"
        else:
            yield line, text
            line, text = token.start[0], token.string.lstrip("#")
        last = token.start[0]
    yield line, text


def page_faults(text):
    # Blocks of code are not prose.
    prose = re.sub(r"^ *```.*?^ *```", "", text, flags=re.S | re.M)
    yield from phrases(prose)
    yield from long_sentences(re.sub(r"<!--.*?-->", "", prose, flags=re.S))


def test_faults_are_seen():
    long = " ".join(["word"] * (LONGEST + 1))
    source = f'''"""What it is. {long.capitalize()}."""
# The car is
# told.
WIDTH_M = 1
"""Of the car."""
raise ValueError("it hangs on a thread, by dead reckoning")
'''
    assert sorted(module_faults(source)) == [
        (1, f"31 words: Word {' '.join(['word'] * 7)} ..."),
        (2, "'is told'"),
        (6, "'hangs on'"),
    ]
    page = (
        f"# Head\n\n- {long[5:]}\n- {long[5:]}, e.g.\n  one\n\n```\n{long}\n```\nIt asks\nfor one. "
    )
    assert [*page_faults(page)] == [
        "'asks for'",
        f"32 words: {' '.join(['word'] * 8)} ...",
    ]


def test_inverted_sentences_are_seen():
    source = '''"""That it is. What is it? That is why."""
WIDTH_M = 1
"""Width, metres. Of the
car."""

def played():  # Those of one.
    """Play.

    - What it is.
    """
    # Twice. Whatever
    # follows, stays.
'''
    assert sorted(inverted(source)) == [
        (1, "begins with That: That it is."),
        (3, "begins with Of: Of the car."),
        (6, "begins with Those: Those of one."),
        (7, "begins with What: What it is."),
        (11, "begins with Whatever: Whatever follows, stays."),
    ]


@pytest.mark.parametrize(("faults", "programs"), [(inverted, PROGRAMS), (module_faults, MODULES)])
def test_programs_are_in_plain_words(faults, programs):
    found = [
        f"{path.relative_to(ROOT)}:{line}: {fault}"
        for path in programs
        for line, fault in faults(path.read_text())
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_a_page_is_in_plain_words(page):
    found = [*page_faults(page.read_text())]
    assert not found, "\n".join(found)

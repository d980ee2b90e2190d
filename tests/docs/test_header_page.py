"""The reference of the C headers says what stands in them."""

import re

import pytest

from bms.firmware._firmware import ffi, lib
from tests.docs.pages import ROOT
from tools.header_page import header_page

HEADERS = sorted((ROOT / "firmware_c" / "include").glob("*.h"))

SMALL = """\
/* What it is for.
 *
 * More of it, with a < b and 2 * c. */
#ifndef SMALL_H
#define SMALL_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Most that fit. */
#define SMALL_MAX 8
#define SMALL_FEW 2 /* and fewest */

typedef enum { SMALL_OFF = 0, SMALL_ON = 1 } small_state_t;

/* One of them. */
typedef struct {
    float low[SMALL_MAX]; /* in K; the first counts */
} small_t;

extern const small_t SMALL_DEFAULT;

/* This belongs to nothing. */

/* Adds
 * up. */
float small_sum(const small_t *small,
                float first);

#ifdef __cplusplus
}
#endif

#endif
"""

PAGE = """\
# small.h

What it is for.

More of it, with a &lt; b and 2 \\* c.

## Functions

### small_sum

```c
float small_sum(const small_t *small,
                float first);
```

Adds
up.

## Types

### small_state_t

```c
typedef enum { SMALL_OFF = 0, SMALL_ON = 1 } small_state_t;
```

### small_t

```c
typedef struct {
    float low[SMALL_MAX]; /* in K; the first counts */
} small_t;
```

One of them.

## Constants

```c
/* Most that fit. */
#define SMALL_MAX 8
#define SMALL_FEW 2 /* and fewest */
```

## Objects

### SMALL_DEFAULT

```c
extern const small_t SMALL_DEFAULT;
```
"""


def test_a_page_has_comments_and_declarations_by_kind():
    assert header_page("small.h", SMALL) == PAGE


@pytest.mark.parametrize("header", HEADERS, ids=lambda path: path.name)
def test_every_function_and_type_that_the_compiler_knows_of_a_header_has_a_heading(header):
    text = header.read_text(encoding="utf-8")
    headings = set(re.findall(r"^### (\w+)$", header_page(header.name, text), re.MULTILINE))
    declared = {
        name for name in dir(lib) if re.search(rf"^\w[^;{{/]*\b{name}\(", text, re.MULTILINE)
    }
    types = {name for name in ffi.list_types()[0] if re.search(rf"\}} {name};", text)}
    assert headings >= declared | types
    assert declared | types, "no declaration found"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "#ifndef X_H\n#define X_H\n/* Late. */\nint x(void);\n#endif\n",
            "no comment at its beginning",
        ),
        ("/* X. */\nint x(void)\n", "a declaration has no end: int x"),
        ("/* X. */\ntypedef int (*x_t)(void);\n", "not a declaration that a page can be made of"),
    ],
)
def test_what_a_page_cannot_be_made_of_is_told(text, complaint):
    with pytest.raises(ValueError, match=rf"^x\.h: {complaint}"):
        header_page("x.h", text)

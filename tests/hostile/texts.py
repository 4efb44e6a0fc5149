"""Texts and bytes that are no XML, or XML that is meant to hurt its reader."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .case import ARM, Case, change, of_bytes, of_text, of_xacro

# --- text and bytes ---------------------------------------------------------------------------------------------

_BOMB = (
    '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa">'
    + "".join(
        f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    + "]>"
)


def _many_attributes() -> str:
    return "<robot " + " ".join(f'a{i}=""' for i in range(500_000)) + "/>"


def markup() -> Iterator[Case]:
    body = ARM.partition('<robot name="arm">')[2]
    doctypes = {
        "billion laughs": f'{_BOMB}<robot name="&i;">',
        "quadratic blow-up": f'<!DOCTYPE robot [<!ENTITY a "{"a" * 50_000}">]><robot name="{"&a;" * 50_000}">',
        "external entity": '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;">',
        "external entity by http": '<!DOCTYPE robot [<!ENTITY x SYSTEM "http://127.0.0.1:9/">]><robot name="&x;">',
        "parameter entity": '<!DOCTYPE robot [<!ENTITY % x SYSTEM "file:///etc/passwd"> %x;]><robot name="a">',
        "external DTD": '<!DOCTYPE robot SYSTEM "file:///dev/zero"><robot name="a">',
        "DTD behind a comment": '<!-- a --><?a?><!DOCTYPE robot><robot name="a">',
        "endless DTD": "<!DOCTYPE robot [<robot>",
    }
    for name, head in doctypes.items():
        yield of_text(name, head + body, "ModelError", "DOCTYPE")
    ill_formed = {
        "undeclared entity": ARM.replace('"tool"', '"&tool;"'),
        "text after the end": ARM + "x",
        "two roots": ARM + ARM,
        "attribute twice": ARM.replace("<link ", '<link name="a" ', 1),
        "attribute without quotes": ARM.replace('"base"', "base", 1),
        "tags that cross": ARM.replace("</inertial></link>", "</link></inertial>", 1),
        "NUL in the text": ARM.replace("base", "ba\0se", 1),
        "lone surrogate": ARM.replace("base", "ba\ud800se", 1),
        "reference to NUL": ARM.replace("base", "ba&#0;se", 1),
        "escape in a tag": ARM.replace("<axis", "<\x1b[31maxis", 1),
    } | {f"truncated to {x:g}": ARM[: int(x * len(ARM))] for x in (0.1, 0.5, 0.9, 0.999)}
    for name, text in ill_formed.items():
        yield of_text(name, text, "ModelError", "well-formed")
    yield of_text(
        "deep nesting",
        ARM.replace("</link>", "<a>" * 100 + "</a>" * 100 + "</link>", 1),
        "ModelError",
        "deeper than 64",
    )
    yield of_text(
        "deeper nesting",
        lambda: "<robot>" + "<a>" * 90_000 + "</a>" * 90_000 + "</robot>",
        "ModelError",
        "well-formed|deeper",
    )
    yield of_text(
        "two million tags",
        lambda: "<robot>" + "<a/>" * 2_000_000 + "</robot>",
        "ModelError",
        "200000 tags",
    )
    yield of_text(
        "half a million attributes", _many_attributes, "ModelError", "attributes in one tag"
    )
    yield change(
        "attribute of 7 MB",
        '<link name="base"/>',
        lambda: f'<link name="base" x="{"x" * 7_000_000}"/>',
        "sound",
        "",
    )
    yield change(
        "attribute of 9 MB",
        '<link name="base"/>',
        lambda: f'<link name="base" x="{"x" * 9_000_000}"/>',
        "ModelError",
        "characters",
    )
    yield change(
        "comment of 7 MB", "</robot>", lambda: f"<!--{'x' * 7_000_000}--></robot>", "sound", ""
    )
    yield of_text(
        "million comments", lambda: "<!---->" * 1_000_000 + ARM, "ModelError", "200000 tags"
    )
    yield of_text("empty text", "", "ModelError", "no robot is called ''")
    yield of_text("white space", " \n ", "ModelError", "no robot is called")
    yield of_text("angle bracket", "<", "ModelError", "well-formed")
    yield of_text(
        "xacro left", ARM.replace('value="2.5"', 'value="${m}"'), "ModelError", "xacro.*expanded"
    )
    yield of_text(
        "xacro substitution left",
        ARM.replace('"base"', '"$(arg x)"', 1),
        "ModelError",
        "xacro.*expanded",
    )


def files() -> Iterator[Case]:
    plain = ARM.encode()
    declared = '<?xml version="1.0" encoding="{}"?>'
    yield of_bytes(
        "latin-1",
        plain.replace(b'"arm"', b'"\xe4rm"'),
        "ModelError",
        r"arm\.urdf' is not UTF-8 text \(byte 13\)",
    )
    latin = (declared.format("ISO-8859-1") + ARM.replace('"arm"', '"ärm"')).encode("latin-1")
    yield of_bytes("declared latin-1", latin, "ModelError", 'iso8859-1 with repair="encoding"')
    yield of_bytes(
        "declared latin-1 repaired", latin, "sound", r"repaired \(encoding\)", repair=True
    )
    for codec in ("utf-16", "utf-32"):
        yield of_bytes(codec, ARM.encode(codec), "ModelError", f'{codec} with repair="encoding"')
        yield of_bytes(
            f"{codec} repaired", ARM.encode(codec), "sound", "repaired", repair="encoding"
        )
    yield of_bytes(
        "utf-16 without a mark", ARM.encode("utf-16-le"), "ModelError", "well-formed|no robot"
    )
    yield of_bytes("mark of UTF-8", b"\xef\xbb\xbf" + plain, "sound", "")
    yield of_bytes("mark alone", b"\xef\xbb\xbf", "ModelError", "well-formed")
    yield of_bytes("overlong UTF-8", plain.replace(b'"arm"', b'"\xc0\xae"'), "ModelError", "UTF-8")
    yield of_bytes(
        "declared codec that runs code",
        (declared.format("unicode_escape") + ARM).encode() + b"\xff",
        "ModelError",
        "save it as UTF-8$",
    )
    yield of_bytes("empty file", b"", "ModelError", r"arm\.urdf' is not well-formed")
    yield of_bytes("NUL bytes", bytes(1000), "ModelError", "well-formed")
    yield of_bytes("random bytes", np.random.default_rng(0).bytes(5000), "ModelError", "UTF-8")
    yield of_bytes("compressed", b"\x1f\x8b\x08\x00" + bytes(50), "ModelError", "gzip")
    yield of_bytes("carriage returns", plain.replace(b"\n", b"\r\n"), "sound", "")
    yield of_bytes("truncated character", plain[:-1] + b"\xc3", "ModelError", "UTF-8")
    yield of_bytes(
        "comma in a file",
        plain.replace(b'"2.5"', b'"2,5"'),
        "ModelError",
        r"^'arm\.urdf': <inertial> of link 'upper': <mass> value .2,5.",
    )


# --- xacro ------------------------------------------------------------------------------------------------------


def xacros() -> Iterator[Case]:
    yield of_xacro(
        "xacro of an unknown macro",
        "<robot><xacro:nothing/></robot>",
        "ModelError",
        "xacro cannot expand",
    )
    yield of_xacro("xacro without end", "<robot>", "ModelError", "xacro cannot expand")
    yield of_xacro("xacro with a bomb", f'{_BOMB}<robot name="&i;"/>', "ModelError", "DOCTYPE")
    yield of_xacro(
        "xacro includes itself",
        '<robot><xacro:include filename="arm.xacro"/></robot>',
        "ModelError",
        "xacro cannot expand",
    )
    endless = '<robot><xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/></robot>'
    yield of_xacro("xacro without bottom", endless, "ModelError", "xacro cannot expand")
    yield of_xacro(
        "xacro that eats memory",
        '<robot name="${[0]*10**10}"/>',
        "ModelError",
        "xacro cannot expand",
    )
    yield of_xacro(
        "xacro of imports",
        "<robot name=\"${__import__('os').getcwd()}\"/>",
        "ModelError",
        "xacro cannot expand",
    )
    yield of_xacro(
        "xacro with a comma", ARM.replace('"2.5"', '"${5}/2"'), "ModelError", "mass. value"
    )
    yield of_xacro("xacro that is sound", ARM.replace('"2.5"', '"${5/2}"'), "sound", "")


GROUPS = (markup, files, xacros)

"""Documents that are XML and no sound URDF: numbers, inertia, joints, names, structure, mimics, size."""

from __future__ import annotations

from collections.abc import Iterator

from .case import ARM, Case, chain, change, of_text, spoiled
from .rows import ROWS


def rows() -> Iterator[Case]:
    """The cases of `hostile_rows`."""
    for row in ROWS.splitlines():
        if row and not row.startswith("#"):
            name, old, new, outcome, word = (part.strip(" ") for part in f"{row} ".split(" | "))
            yield change(name, old, new, outcome, word)


# --- numbers ----------------------------------------------------------------------------------------------------

_NOT_A_NUMBER = {
    "comma": "2,5",
    "unit": "2.5kg",
    "spaced unit": "2.5 kg",
    "nan": "nan",
    "NaN": "NaN",
    "inf": "inf",
    "minus infinity": "-Infinity",
    "overflow": "1e999",
    "beyond the largest": "1e31",
    "hexadecimal": "0x1p3",
    "fortran exponent": "2.5d0",
    "underscore": "2_5",
    "empty": "",
    "blank": "  ",
    "word": "heavy",
    "two numbers": "2.5 1",
    "two signs": "--2.5",
    "arabic digits": "\u0662",
    "full-width digits": "\uff12",
    "fraction": "5/2",
    "expression": "2+0.5",
    "locale thousands": "2.500,0",
    "many digits": "1" * 2000,
    "many zeros": "0" * 2000 + "1",
    "escape sequence": "&#x9b;2J",
    "trailing dot dot": "2..",
    "unicode minus": "\u22122.5",
    "half an exponent": "2.5e",
}


def numbers() -> Iterator[Case]:
    for what, text in _NOT_A_NUMBER.items():
        yield change(f"mass {what}", 'value="2.5"', f'value="{text}"', "ModelError", "mass. value")
    for attribute, old in {
        "joint xyz": 'xyz="0 0 0.3"',
        "joint rpy": 'rpy="0 0 0.5"',
        "axis": 'xyz="0 1 0"',
        "centre of mass": 'xyz="0 0 0.2"',
        "lower": 'lower="-1.5"',
        "upper": 'upper="2"',
        "effort": 'effort="30"',
        "velocity": 'velocity="4"',
        "damping": 'damping="0.3"',
        "friction": 'friction="0.1"',
        "ixx": 'ixx="0.04"',
        "iyz": 'iyz="0" izz="0.02"',
    }.items():
        key = old.partition("=")[0]
        rest = old.partition('" ')[2]
        yield change(f"{attribute} nan", old, f'{key}="nan" {rest}', "ModelError", f"{key} .nan.")
    yield change(
        "million numbers", 'xyz="0 1 0"', lambda: f'xyz="{"1 " * 10**6}"', "ModelError", "3 finite"
    )


# --- inertia ----------------------------------------------------------------------------------------------------


def inertia() -> Iterator[Case]:
    none = ARM.replace("<inertial>", "<visual>").replace("</inertial>", "</visual>")
    yield of_text("no inertia anywhere", none, "UnsupportedJointError", "have no mass")
    for mass in ("0", "1e-30", "1e-320"):
        text = ARM.replace('value="2.5"', f'value="{mass}"').replace(
            'value="1.5"', f'value="{mass}"'
        )
        yield of_text(f"both masses {mass}", text, "UnsupportedJointError", "'slide'")
    text = none.replace("<link", '<link note=""', 1)
    yield of_text("armature alone", text, "UnsupportedJointError", "massless=True", armature=0.1)
    yield of_text("no mass on request", text, "sound", "NO GRAVITY", armature=0.1, massless=True)
    yield change(
        "two inertials",
        '</inertial></link>\n<link name="hand">',
        '</inertial><inertial/></link>\n<link name="hand">',
        "ModelError",
        "2 <inertial>",
    )
    for name, old, new in (
        ("mass 1e30", 'value="2.5"', 'value="1e30"'),
        ("far mass 1e30", 'value="1.5"', 'value="1e30"'),
        ("moment 1e30", 'iyy="0.05"', 'iyy="1e30"'),
        ("centre of mass 1e30", 'xyz="0.1 0 0"', 'xyz="0 0 1e30"'),
        ("origin 1e30", 'xyz="0 0 0.4"', 'xyz="0 0 1e30"'),
        ("origin 1e15", 'xyz="0 0 0.4"', 'xyz="0 0 1e15"'),
    ):
        yield change(name, old, new, "ModelError", "give masses in kg")
    everywhere = ARM.replace('value="2.5"', 'value="1e30"').replace('value="1.5"', 'value="1e30"')
    yield of_text("all masses 1e30", everywhere, "ModelError", "has the inertia 1e.30")
    uneven = spoiled(('value="2.5"', 'value="1e11"'), ('value="1.5"', 'value="1e-5"'))
    weightless = ARM.partition('iyz="0" izz="0.013"')[0].rpartition("<inertia ")[2]
    uneven = uneven.replace(weightless, 'ixx="0" ixy="0" ixz="0" iyy="0" ').replace("0.013", "0")
    yield of_text("masses of 1e11 and 1e-5", uneven, "ModelError", "too little for floating point")


# --- axes, limits, origins --------------------------------------------------------------------------------------


def joints() -> Iterator[Case]:
    limit = '<limit lower="-1.5" upper="2" effort="30" velocity="4"/>'
    yield change(
        "no limit", limit, "", "ModelError", 'make it type="continuous"; repair="no-limit"'
    )
    slide = '<limit lower="-0.1" upper="0.4" effort="20" velocity="1"/>'
    yield change("prismatic without limit", slide, "", "ModelError", "has no <limit>; add")
    yield change("two limits", limit, limit * 2, "ModelError", "2 <limit>")
    yield change("empty limit", limit, "<limit/>", "sound", "equals the upper one at 'shoulder'")
    for kind in ("planar", "floating"):
        text = spoiled(('type="revolute"', f'type="{kind}"'))
        yield of_text(f"{kind} joint", text, "UnsupportedJointError", 'lock=."shoulder",')
        yield of_text(f"{kind} joint locked", text, "sound", "", lock=("shoulder",))
    yield change(
        "empty type", 'type="revolute"', 'type=""', "ModelError", "needs the attribute type"
    )
    for kind in ("Revolute", "hinge", "revolute\n", "x" * 40_000, "&#x9b;31m", "screw"):
        yield change(
            f"type {kind[:12]!r}", 'type="revolute"', f'type="{kind}"', "ModelError", "unknown type"
        )


# --- names and structure ----------------------------------------------------------------------------------------


def structure() -> Iterator[Case]:
    joint = '<joint name="{}" type="fixed"><parent link="{}"/><child link="{}"/></joint></robot>'
    end = "</robot>"
    yield change(
        "link universe",
        'link name="base"',
        'link name="universe"',
        "ModelError",
        "reserved|there is no <link",
    )
    yield change(
        "name of a million letters",
        'name="mount"',
        lambda: f'name="{"m" * 10**6}"',
        "ModelError",
        "at most 256",
    )
    yield change(
        "cycle without root", "</robot>", joint.format("k", "tool", "base"), "ModelError", "circle"
    )
    yield change(
        "two parents",
        "</robot>",
        joint.format("k", "base", "tool"),
        "ModelError",
        "child of two joints",
    )
    ring = '<link name="x"/><link name="y"/>' + (joint * 2).replace(end, "")
    yield change(
        "ring beside the tree",
        end,
        ring.format("k", "x", "y", "l", "y", "x") + end,
        "ModelError",
        "circle",
    )
    yield of_text("no link", "<robot/>", "ModelError", "no <link>")
    yield of_text("one link", '<robot><link name="a"/></robot>', "ModelError", "no movable joint")
    fixed = ARM.replace('"revolute"', '"fixed"').replace('"prismatic"', '"fixed"')
    yield of_text("fixed joints only", fixed, "ModelError", "no movable joint")
    yield of_text(
        "joints without links",
        '<robot><joint name="a" type="fixed"/></robot>',
        "ModelError",
        "no <parent>",
    )
    for root in ("sdf", "mujoco", "Robot", "a" * 40_000):
        yield of_text(f"root <{root[:8]}>", f"<{root}/>", "ModelError", "is no URDF: its root")
    yield change(
        "elements in a foreign namespace",
        "<robot ",
        '<x:robot xmlns:x="u" ',
        "ModelError",
        "well-formed|URDF",
    )
    yield of_text(
        "link inside a link",
        ARM.replace('<link name="tool"/>', '<link name="o"><link name="tool"/></link>'),
        "ModelError",
        "child link 'tool', and there is no",
    )


def mimics() -> Iterator[Case]:
    limit = 'effort="20" velocity="1"/>'

    def mimic(rule: str) -> str:
        return spoiled((limit, f"{limit}<mimic {rule}/>"))

    yield of_text(
        "mimic of nothing", mimic("multiplier='2'"), "ModelError", "needs the attribute joint"
    )
    yield of_text(
        "mimic of an unknown joint",
        mimic('joint="shouldr"'),
        "UnsupportedJointError",
        "did you mean 'shoulder'",
    )
    yield of_text("mimic of itself", mimic('joint="slide"'), "UnsupportedJointError", "circle")
    yield of_text(
        "mimic of a fixed joint",
        mimic('joint="mount"'),
        "UnsupportedJointError",
        r"'mount' \(fixed\)",
    )
    yield of_text(
        "mimic nan", mimic('joint="shoulder" multiplier="nan"'), "ModelError", "multiplier .nan."
    )
    yield of_text(
        "mimic of a link", mimic('joint="hand"'), "UnsupportedJointError", "does not exist"
    )
    yield of_text(
        "two mimics", mimic('joint="shoulder"/><mimic joint="shoulder"'), "ModelError", "2 <mimic>"
    )
    yield of_text("mimic by 0", mimic('joint="shoulder" multiplier="0"'), "sound", "")
    yield of_text(
        "mimic by 1e30",
        mimic('joint="shoulder" multiplier="1e30"'),
        "ModelError",
        "has the inertia",
    )
    far = chain(300).replace("<axis", '<mimic joint="NOBODY"/><axis')
    for i in range(300):
        far = far.replace("NOBODY", "nobody" * 40 + str(i), 1)
    far = far.replace(f'<mimic joint="{"nobody" * 40}0"/>', "")
    yield of_text(
        "300 mimics of nobody",
        far,
        "UnsupportedJointError",
        "does not exist; there are.*; ...; correct",
    )
    circle = mimic('joint="shoulder"').replace(
        'friction="0.1"/>', 'friction="0.1"/><mimic joint="slide"/>'
    )
    yield of_text("circle of mimics", circle, "ModelError", "no movable joint")
    follow = '<mimic joint="PREVIOUS" multiplier="{}"/>'
    yield of_text(
        "mimics that overflow",
        chain(30, more=follow.format("1e30")),
        "UnsupportedJointError",
        "beyond 1e",
    )
    yield of_text("chain of 150 mimics", lambda: chain(150, more=follow.format("1")), "sound", "")
    many = "500 joints move; at most 200"
    yield of_text(
        "chain of 500 mimics", lambda: chain(500, more=follow.format("1")), "ModelError", many
    )
    free = (
        chain(1)
        .partition('<link name="l0"/>')[2]
        .replace('"l1"', '"free"')
        .replace('"j1"', '"turn"')
    )

    def with_free() -> str:
        return chain(998, more=follow.format("1")).replace("</robot>", free)

    locked = [f"j{i}" for i in range(1, 999)]
    yield of_text(
        "chain of 998 mimics locked",
        with_free,
        "sound",
        "",
        lock=locked,
        locked_configuration={"j1": 0.1},
    )


# --- size -------------------------------------------------------------------------------------------------------


def sizes() -> Iterator[Case]:
    yield of_text(
        "chain of 1100 joints", lambda: chain(1100), "ModelError", "at most 1000 are read"
    )
    yield of_text(
        "chain of 999 joints",
        lambda: chain(999),
        "ModelError",
        "999 joints move; at most 200",
    )
    yield of_text("chain of 999, one kept", lambda: chain(999), "sound", "", joints=["j1"], lock=())
    yield of_text(
        "chain of 999 fixed joints", lambda: chain(999, "fixed"), "ModelError", "no movable joint"
    )
    yield of_text("star of 999 joints", lambda: chain(999, star=True), "ModelError", "at most 200")
    yield of_text(
        "999 floating joints", lambda: chain(999, "floating"), "UnsupportedJointError", "lock="
    )
    yield of_text("chain of 200 joints", lambda: chain(200), "sound", "")


GROUPS = (rows, numbers, inertia, joints, structure, mimics, sizes)

"""The strict XML parse: what it refuses before anything else sees the text."""

from __future__ import annotations

import pytest

import rbimpedance as rbi
from rbimpedance.robot.loading import strict_xml
from rbimpedance.robot.loading.strict_xml import has_doctype, read_xml
from rbimpedance.robot.loading.xml_faults import MAX_DEPTH

BOMB = """<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>
<robot name="&b;"/>"""


@pytest.mark.parametrize(
    "text",
    [
        BOMB,
        '<!DOCTYPE robot SYSTEM "file:///etc/passwd"><robot/>',
        "<!-- a comment --> <?pi <!-- ?> <!DOCTYPE robot> <!-- --> <robot/>",
        "\ufeff  <!DOCTYPE robot><robot/>",
    ],
)
def test_doctype_is_refused_wherever_it_hides(text: str) -> None:
    with pytest.raises(rbi.ModelError, match="the text declares a DOCTYPE"):
        read_xml(text, "the text")


@pytest.mark.parametrize(
    "text",
    [
        "<robot/>",
        "<!-- <!DOCTYPE robot> --><robot/>",
        "<?pi <!DOCTYPE robot> ?><robot/>",
        "<robot><![CDATA[<!DOCTYPE robot>]]></robot>",
        "<!-- never closed",
        "",
    ],
)
def test_mention_of_a_doctype_is_none(text: str) -> None:
    assert not has_doctype(text)


@pytest.mark.parametrize(
    "text",
    ["", "<robot>", "<robot></link>", '<robot name="a" name="b"/>', "<a/><b/>", "&nbsp;", "\0"],
)
def test_text_that_is_no_xml_is_refused(text: str) -> None:
    with pytest.raises(rbi.ModelError, match="the text is not well-formed XML"):
        read_xml(text, "the text")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot>\n<link>\n</robot>", r"line 3, column 9: </robot> closes <link> of line 2$"),
        ("<robot>", "line 1, column 8: the file ends before every tag is closed"),
        ("<robot name=a/>", "the value of an attribute is not in quotes.*near: <robot name=a/>"),
        ('<robot name="a name="b"/>', "a space or a quote is missing between two attributes"),
        ('<robot name="a" name="b"/>', "an attribute is given twice"),
        ('<robot name="r&d"/>', "write &amp; for the character &"),
        ("<robot/><robot/>", "there is content after the end of the root element"),
        ("<robot>&nbsp;</robot>", "only the entities &lt; &gt;"),
        ("<a>" * 300 + "</a>" * 300, "it nests elements deeper than 64: that is no URDF"),
        ("just words", "there is no element in it"),
    ],
)
def test_fault_of_the_xml_is_said_in_words_of_xml_with_its_place(text: str, words: str) -> None:
    with pytest.raises(rbi.ModelError, match=words) as caught:
        read_xml(text, "the text")
    for raw in ("libxml2", "XML_PARSE", "EntityRef", "AttValue", "<string>", "tag mismatch"):
        assert raw not in str(caught.value)


@pytest.mark.parametrize("text", ["<!DOCTYPE html>\n<html/>", "<html lang='en'/>", "<HTML/>"])
def test_web_page_is_told_from_a_description(text: str) -> None:
    with pytest.raises(rbi.ModelError, match=r"is a web page \(HTML\).*download the raw file"):
        read_xml(text, "the text")


@pytest.mark.parametrize(
    "part",
    [
        "<gazebo><controller:plugin filename='a.so'/></gazebo>",
        "<gazebo reference='a'><params>$(find pkg)/a.yaml</params></gazebo>",
        "<ros2_control name='x'><param name='p'>${prefix}a</param></ros2_control>",
        "<transmission name='t'><joint name=' nobody '/><mass value='heavy'/></transmission>",
        "<gazebo>" + "<a>" * 100 + "</a>" * 100 + "</gazebo>",
    ],
)
def test_parts_outside_the_kinematics_are_dropped(part: str) -> None:
    root = read_xml(f"<robot><link name='a'/>{part}</robot>", "the text")
    assert [child.tag for child in root] == ["link"]


def test_lone_surrogate_is_refused() -> None:
    with pytest.raises(rbi.ModelError, match="not well-formed"):
        read_xml('<robot name="\ud800"/>', "the text")


def test_undeclared_entity_is_refused() -> None:
    with pytest.raises(rbi.ModelError, match="not well-formed"):
        read_xml("<robot>&xxe;</robot>", "the text")


def test_depth_is_bounded() -> None:
    depth = MAX_DEPTH
    read_xml("<a>" * depth + "</a>" * depth, "the text")
    with pytest.raises(rbi.ModelError, match=f"deeper than {depth}"):
        read_xml("<a>" * (depth + 1) + "</a>" * (depth + 1), "the text")


def test_nesting_beyond_the_parser_is_refused_too() -> None:
    with pytest.raises(rbi.ModelError):
        read_xml("<a>" * 100_000 + "</a>" * 100_000, "the text")


def test_size_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(strict_xml, "MAX_CHARACTERS", 100)
    read_xml("<a>" + "x" * 93 + "</a>", "the text")
    with pytest.raises(rbi.ModelError, match="more than 100 characters"):
        read_xml("<a>" + "x" * 94 + "</a>", "the text")


def test_tags_and_attributes_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(strict_xml, "MAX_TAGS", 4)
    monkeypatch.setattr(strict_xml, "MAX_ATTRIBUTES", 2)
    read_xml('<a b="" c=""><d e="" f=""/><g h=""/></a>', "the text")
    with pytest.raises(rbi.ModelError, match="the text has more than 4 tags"):
        read_xml("<a><b/><c/><d/></a>", "the text")
    with pytest.raises(rbi.ModelError, match="the text has more than 2 attributes in one tag"):
        read_xml('<a b="" c="" d=""/>', "the text")


@pytest.mark.parametrize(
    "text",
    [
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="a"/></robot>',
        '<robot xmlns:x="http://ros.org/wiki/xacro"><x:macro/></robot>',
        '<robot><xacro:include filename="a"/></robot>',
        '<robot><link><mass value="${2*m}"/></link></robot>',
        '<robot><link><mesh filename="$(find pkg)/a.stl"/></link></robot>',
        "<robot><link>${name}</link></robot>",
    ],
)
def test_xacro_that_is_not_expanded_is_named(text: str) -> None:
    with pytest.raises(
        rbi.ModelError, match=r"xacro that has not been expanded.*xacro file\.xacro >"
    ):
        read_xml(text, "the text")


def test_xacro_namespace_and_comments_alone_are_no_fault() -> None:
    text = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><!-- ${left} --></robot>'
    assert read_xml(text, "the text").tag == "robot"


def test_declared_encoding_does_not_matter_for_text() -> None:
    text = '<?xml version="1.0" encoding="UTF-16"?><robot name="ä"/>'
    assert read_xml(text, "the text").get("name") == "ä"

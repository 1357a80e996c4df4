from __future__ import annotations

import builtins

import pytest
from tests.mjcf_files import ball, written

from stiffdice.errors import InputError, NotInstalledError
from stiffdice.simulation.engines.mjcf.model import load, tags_of


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("timestep: 0.001", "not an XML file (syntax error: line 1, column 0)"),
        ("<mujoco><worldbody></mujoco>", "not an XML file (mismatched tag: line 1"),
        ('<robot name="a"/>', "is a URDF; allowed is a model in MuJoCo's MJCF, <mujoco>"),
        ("<sdf/>", "is an SDF; allowed is"),
        ("<mujocoinclude/>", "is a part that models include; allowed is"),
        ("<html/>", "is a file of <html>; allowed is"),
        ('<!DOCTYPE mujoco [<!ENTITY a "b">]><mujoco/>', "declares entities; allowed is XML without them"),
    ],
)
def test_what_is_no_mjcf_is_refused_in_one_line(text, words, tmp_path):
    with pytest.raises(InputError) as caught:
        load(written(text, tmp_path))
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path}/model.xml: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<mujoco><asset><mesh file="gone.stl"/></asset></mujoco>', "gone.stl"),
        ("<mujoco><what/></mujoco>", "what"),
        ('<mujoco><include file="gone.xml"/></mujoco>', "gone.xml"),
    ],
)
def test_what_mujoco_does_not_take_is_told_in_its_words(text, words, tmp_path):
    pytest.importorskip("mujoco")
    with pytest.raises(InputError, match="MuJoCo does not take it: ") as caught:
        load(written(text, tmp_path))
    assert words in str(caught.value)
    assert "\\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"gone\.xml: No such file or directory"):
        load(tmp_path / "gone.xml")


def test_without_mujoco_it_says_how_to_install_it(tmp_path, monkeypatch):
    real = builtins.__import__

    def none(name, *arguments, **keywords):
        if name == "mujoco":
            raise ModuleNotFoundError(name)
        return real(name, *arguments, **keywords)

    monkeypatch.setattr(builtins, "__import__", none)
    with pytest.raises(NotInstalledError, match=r"needs the package mujoco, .*; make install-engines"):
        load(written(ball(), tmp_path))


def test_tags_are_found_with_their_bytes():
    text = '<mujoco>\n<!-- <geom/> ü --><a b="1 > 0"\n c=\'"\'/><d>text</d></mujoco>'
    tags = tags_of(text, "a file")
    assert [(tag.name, tag.parents) for tag in tags] == [("mujoco", ()), ("a", ("mujoco",)), ("d", ("mujoco",))]
    assert text.encode()[tags[1].start : tags[1].end].decode() == '<a b="1 > 0"\n c=\'"\'/>'
    assert tags[1].attributes == {"b": "1 > 0", "c": '"'}

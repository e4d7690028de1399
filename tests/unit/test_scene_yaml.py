"""Reading YAML: the types of YAML 1.2, places, budgets, and what a person is told."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from skincli.errors import InputError, LimitError, SkincliError
from skincli.scene import yaml
from skincli.scene.model import Scene
from skincli.scene.yaml import load_file, load_text, validate


def messages(text: str, error: type[SkincliError] = InputError, label: str = "f.yaml") -> list[str]:
    with pytest.raises(error) as caught:
        load_text(text, label)
    return str(caught.value).split("\n")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *((text, None) for text in ("~", "null", "Null", "NULL", "")),
        *((text, text in ("true", "True", "TRUE")) for text in ("true", "True", "TRUE", "false", "False", "FALSE")),
        *((text, text) for text in ("no", "yes", "on", "off", "y", "n", "12:30:00", "2024-02-30", "1_000", "nULL")),
        *((text, text) for text in ("0x", "0o8", "-0x1F", ".", "1e", "e3", "+", "inf", ".iNf", "-.nan", "0b1", "1,5")),
        ("0", 0),
        ("017", 17),
        ("-7", -7),
        ("+7", 7),
        ("0o17", 15),
        ("0x1F", 31),
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        ("+.5", 0.5),
        ("5.", 5.0),
        ("-1.5e+2", -150.0),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("'12'", "12"),
        ('"null"', "null"),
        ("!!str 12", "12"),
        ("! 12", "12"),
        ("!!int '3'", 3),
        ("!!float 3", 3.0),
        ("!!null ''", None),
        ("!!map {a: !!seq [1]}", {"a": [1]}),
        ("%YAML 1.1\n--- no", "no"),
        ("{1: a, no: b, ~: c}", {"1": "a", "no": "b", "~": "c"}),
        ("{a: &x [1, {b: 2}], c: *x}", {"a": [1, {"b": 2}], "c": [1, {"b": 2}]}),
        ("\ufeff{a: 1}", {"a": 1}),
    ],
)
def test_values_of_the_core_schema(text: str, value: object) -> None:
    found = load_text(text, "f").values
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize("text", [".nan", ".NaN", ".NAN"])
def test_nan(text: str) -> None:
    assert math.isnan(load_text(text, "f").values)


def test_marks_are_one_based_and_name_values_or_keys() -> None:
    document = load_text("a: 1\nb:\n  - c:  x\n    é: [1, zz]\n", "f")
    assert document.mark(("b", 0, "c"))[1:] == (3, 9)
    assert document.mark(("b", 0, "c"), key=True)[1:] == (3, 5)
    assert document.mark(("b", 0, "é", 1))[1:] == (4, 12)
    assert document.mark(("b", 0, "é", 7, "q"))[1:] == (4, 8)
    assert document.mark(("none",))[1:] == (1, 1)
    assert document.mark(()).file == "f"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "a: 1\na: 2\nb: {c: 1,\n  c: 2}",
            [
                "f.yaml:2:1: the key 'a' is already at 1:1; remove one of them",
                "f.yaml:4:3: the key 'c' is already at 3:5; remove one of them",
            ],
        ),
        (
            "a: !!python/object/apply:os.system [x]\nb: !mine 1\nc: !!int 1.5\nd: !!set {x}",
            [
                "f.yaml:1:4: the tag !!python/object/apply:os.system is not allowed here; remove it",
                "f.yaml:2:4: the tag !mine is not allowed here; remove it",
                "f.yaml:3:4: '1.5' is not what its tag !!int says; remove the tag",
                "f.yaml:4:4: the tag !!set is not allowed here; remove it",
            ],
        ),
        (
            "<<: {a: 1}\n? [x]\n: 1",
            [
                "f.yaml:1:1: merge keys (<<) are not YAML 1.2; write the keys out",
                "f.yaml:2:3: a key must be text, not a list, a mapping or an alias",
            ],
        ),
        ("a: &x [*x]", ["f.yaml:1:8: the alias *x contains itself; write the value out"]),
        ("a: *y", ["f.yaml:1:4: the alias *y has no anchor before it; mark the value meant with &y"]),
        ("--- 1\n--- 2", ["f.yaml:2:1: a second document begins here; one file holds one document"]),
        ("a: x\0", ["f.yaml:1:5: there is a NUL character; the file is not text, or damaged"]),
        ("a:\n  b: \x07", ["f.yaml:2:6: there is a control character that YAML does not allow; remove it"]),
        ("a: " + "9" * 301, ["f.yaml:1:4: a whole number has at most 300 digits; this has 301"]),
        ("a: \udcff", ["f.yaml:1:4: there is a character that is not Unicode; write UTF-8"]),
    ],
)
def test_refused(text: str, expected: list[str]) -> None:
    assert messages(text) == expected


@pytest.mark.parametrize(
    ("text", "place", "hint"),
    [
        ("a:\n\t- 1", "f.yaml:2:1:", "indent with spaces, not tabs"),
        ("a: @b", "f.yaml:1:4:", "put text that begins with '@' in quotes"),
        ("a: b: c", "f.yaml:1:5:", "put text that contains ': ' in quotes"),
        ("a: [1,", "f.yaml:", "look for a missing bracket"),
    ],
)
def test_broken_syntax_has_a_place_and_a_hint(text: str, place: str, hint: str) -> None:
    (message,) = messages(text)
    assert message.startswith(place + (" this is not valid YAML: " if place.count(":") == 3 else ""))
    assert "this is not valid YAML: " in message
    assert message.count(hint) == 1


def test_syntax_faults_come_with_those_before_them() -> None:
    assert [message.partition(": ")[0] for message in messages("a: 1\na: 2\nb: [")[:1]] == ["f.yaml:2:1"]


BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{name}: &{name} [{','.join([f'*{before}'] * 9)}]\n" for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "the document holds more than 100,000 values with its aliases expanded; make it smaller"),
        ("[" * 20000, "f.yaml:1:65: the nesting is deeper than 64 levels; flatten it"),
        ("- " * 20000 + "x", "f.yaml:1:129: the nesting is deeper than 64 levels; flatten it"),
        ("{a: " * 80 + "1" + "}" * 80, "the nesting is deeper than 64 levels; flatten it"),
        ("x: " + "a" * 1_000_000, "f.yaml: the text is larger than 1,000,000 bytes; make it smaller"),
    ],
)
def test_beyond_the_budgets(text: str, message: str) -> None:
    (found,) = messages(text, LimitError)
    assert found.endswith(message)
    assert LimitError.exit_code == 6


def test_within_the_budgets() -> None:
    assert load_text("[" * 63 + "1" + "]" * 63, "f").values is not None
    shared = "a: &a [" + "1," * 900 + "]\nb: [" + "*a," * 100 + "]"
    assert len(load_text(shared, "f").values["b"][99]) == 900


def test_the_python_parser_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "a: &x {b: [1, 'é']}\nc: *x\nd: >\n  long\n  text\n"
    fast = load_text(text, "f")
    monkeypatch.setattr(yaml, "_Loader", yaml.yaml.SafeLoader)
    assert load_text(text, "f").root == fast.root


def test_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_bytes(b"\xef\xbb\xbfa: \xc3\xa9\n")
    (tmp_path / "latin.yaml").write_bytes(b"a: 1\nb: \xe9\n")
    (tmp_path / "big.yaml").write_bytes(b"#" * 1_000_001)
    assert load_file("scene.yaml").values == {"a": "é"}
    for name, error, message in [
        ("latin.yaml", InputError, "latin.yaml:2:4: the byte 0xe9 is not UTF-8; save the file with the encoding UTF-8"),
        ("big.yaml", LimitError, "big.yaml: the file is larger than 1,000,000 bytes; a scene or skin must be smaller"),
        ("scen.yaml", InputError, f"scen.yaml: no such file in '{tmp_path}'; did you mean 'scene.yaml'?"),
        ("no/x.yaml", InputError, f"no/x.yaml: no such file: there is no folder '{tmp_path / 'no'}'"),
        (".", InputError, ".: that is a folder; name a YAML file in it"),
    ]:
        with pytest.raises(error) as caught:
            load_file(name)
        assert str(caught.value) == message


# One table of what a person sees when a line of a good scene is replaced by a bad one.
GOOD = """scene: 1
mesh: {builtin: creature, detail: 259k}
camera: {position: [0, 0, 600], target: [0, 0, 0]}
ambient: [0, 0, 0]
lights: []
render: {}
outputs: [beauty]
"""
FAULTS = [
    ("scene: 2", "1:8: scene is 2; it must be 1"),
    ("scene: '1'", "1:8: scene is '1'; it must be 1; remove the quotes"),
    ("sene: 1", "1:1: the scene has no key 'sene'; did you mean 'scene'? It has: ambient, background, camera, "
     "environment, lights, mesh, outputs, parts, render, scene, skin."),
    ("mesh: {fiel: a.obj}", "2:8: mesh has no key 'fiel'; did you mean 'file'? It has: builtin, detail, file, unit."),
    ("mesh: {file: a.obj}", "2:1: mesh: a .obj file does not say its unit; write unit: mm (or cm, m, in, or the "
     "millimetres per unit)"),
    ("mesh: {file: a.obj, unit: 3 mm}", "2:27: mesh.unit is '3 mm'; it must be one of mm, cm, m, in, or the "
     "millimetres per unit, above 0; did you mean 'mm'?"),
    ("mesh: {file: a.obj, unit: 0}", "2:27: mesh.unit is 0; it must be one of mm, cm, m, in, or the "
     "millimetres per unit, above 0"),
    ("mesh: {file: a.obj, builtin: head}", "2:1: mesh: both file and builtin is given; write one of them, such as "
     "{file: head.obj, unit: mm}"),
    ("mesh: {}", "2:1: mesh: neither file nor builtin is given; write one of them, such as {file: head.obj, unit: mm}"),
    ("mesh: {builtin: head, unit: mm}", "2:1: mesh: unit belongs to a file; a built-in mesh is in millimetres; "
     "remove unit"),
    ("mesh:", "2:1: mesh has no value; it must be a mapping, key: value"),
    ("mesh: head.obj", "2:7: mesh is 'head.obj'; it must be a mapping, key: value"),
    ("mesh: {builtin: head, detail: 1.5k}", "2:31: mesh.detail is '1.5k'; it must be a whole number (triangles of the "
     "built-in mesh, about; 259k is 259000); write the number alone, without a unit"),
    ("camera: {position: [0, 0, 1], target: [0, 0, 0], fov: 190}", "3:55: camera.fov is 190; it must be less than 180"),
    ("camera: {position: [0, 0, 1], target: [0, 0, 0], fov: 1e-3 deg}", "3:55: camera.fov is '1e-3 deg'; it must be a "
     "number (vertical field of view, degrees); write the number alone, without a unit"),
    ("camera: {position: [0, 0, 1], target: [0, 0, 0], fov: '30'}", "3:55: camera.fov is '30'; it must be a "
     "number (vertical field of view, degrees); remove the quotes"),
    ("camera: {position: [0, 0, 1], target: [0, 0, 0], fov: true}", "3:55: camera.fov is true; it must be a "
     "number (vertical field of view, degrees)"),
    ("camera: {position: [0, 0, 1], target: [0, 0, 0], fov: .nan}", "3:55: camera.fov is nan; it must be a "
     "finite number"),
    ("camera: {position: [0, 0, 1], target: [0, 0, 0], fov: }", "3:50: camera.fov has no value; it must be a "
     "number (vertical field of view, degrees)"),
    ("camera: {position: [1, 2, 3], target: [1, 2, 3]}", "3:1: camera: position and target are both [1.0, 2.0, 3.0], "
     "so it looks nowhere; move one of them"),
    ("camera: {position: [0, 9, 0], target: [0, 0, 0]}", "3:1: camera: it looks along its own up, [0.0, 1.0, 0.0], so "
     "the picture's turn is undefined; give another up, such as [0, 0, 1]"),
    ("camera: {position: [0, 9], target: [0, 0, a]}", "3:20: camera.position has 2 items; it must have 3\n"
     "3:43: camera.target[2] is 'a'; it must be a number"),
    ("camera: {target: [0, 0, 0]}", "3:1: camera lacks the key 'position' (where it stands, mm); add it"),
    ("ambient: [0, 0, -1]", "4:17: ambient[2] is -1; it must be at least 0"),
    ("ambient: 0.1", "4:10: ambient is 0.1; it must be a list (ambient light; three numbers, linear Rec.709)"),
    ("lights: [{type: pont}]", "5:17: lights[0].type is 'pont'; it must be one of directional, point, spot; "
     "did you mean 'point'?"),
    ("lights: [{}]", "5:10: lights[0] lacks the key 'type'; add it, one of directional, point, spot"),
    ("lights: [{type: point, position: [0, 0, 0], intensity: [1, 1, 1], point: 3}]", "5:67: lights[0] has no key "
     "'point'; did you mean 'position'? It has: intensity, position, type."),
    ("lights: [{type: directional, direction: [0, 0, 0], irradiance: [1, 1, 1]}]", "5:41: lights[0].direction is "
     "[0, 0, 0]; it must not be zero"),
    ("lights: [{type: spot, position: [0, 0, 0], direction: [1, 0, 0], intensity: [1, 1, 1], angle: 180, blend: 2}]",
     "5:95: lights[0].angle is 180; it must be less than 180\n5:107: lights[0].blend is 2; it must be at most 1"),
    ("render: {size: [0, 1000000]}", "6:17: render.size[0] is 0; it must be at least 1\n"
     "6:20: render.size[1] is 1000000; it must be at most 16384"),
    ("render: {size: [1.5, 2]}", "6:17: render.size[0] is 1.5; it must be a whole number"),
    ("render: {shading: papr}", "6:19: render.shading is 'papr'; it must be one of physical, paper; "
     "did you mean 'paper'?"),
    ("render: {effects: {blur: no}}", "6:26: render.effects.blur is 'no'; it must be true or false (diffusion of light "
     "below the surface); write false"),
    ("render:", "6:1: render has no value; it must be a mapping, key: value; write {} for its defaults"),
    ("render: {occlusion: {a: 0, b: 0}}", "6:10: render.occlusion: a and b are 0 and 0; give at least one of them a "
     "weight of 1e-06 or more"),
    ("outputs: []", "7:10: outputs has 0 items; it must have at least 1"),
    ("outputs: [beauty, beuaty]", "7:19: outputs[1] is 'beuaty'; no output has that name; did you mean 'beauty'? "
     "There are: beauty, depth"),
    ("outputs: [beauty, beauty]", "7:10: outputs is ['beauty', 'beauty']; each output may be named once; "
     "remove the second 'beauty'"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "expected"), FAULTS)
def test_messages(line: str, expected: str) -> None:
    number = int(expected.partition(":")[0])
    lines = GOOD.split("\n")
    lines[number - 1] = line
    with pytest.raises(InputError) as caught:
        validate(load_text("\n".join(lines), "portrait.yaml"), Scene, {"outputs": ("beauty", "depth")})
    found = str(caught.value).split("\n")
    wanted = [f"portrait.yaml:{text}" for text in expected.split("\n")]
    # A misspelled required key is also missing under its right name.
    assert [text for text in found if " lacks the key 'scene'" not in text] == wanted
    assert caught.value.exit_code == 3


def test_the_good_scene_is_good() -> None:
    scene = validate(load_text(GOOD, "f"), Scene)
    assert scene.mesh.detail == 259_000
    assert scene.camera is not None
    assert scene.camera.position == (0, 0, 600)


def test_all_faults_in_the_order_of_the_text() -> None:
    text = "outputs: 3\nmesh: {builtin: 5}\nscene: 1\nlights: 7\ncamera: 1\n"
    with pytest.raises(InputError) as caught:
        validate(load_text(text, "f"), Scene)
    assert [fault.line for fault in caught.value.faults] == [1, 2, 4, 5]


@pytest.mark.parametrize(("text", "found"), [("", "is empty"), ("3", "is 3"), ("[a]", "is ['a']")])
def test_a_scene_that_is_no_mapping(text: str, found: object) -> None:
    with pytest.raises(InputError) as caught:
        validate(load_text(text, "f"), Scene)
    assert str(caught.value) == f"f:1:1: the scene {found}; it must be a mapping, key: value"


def test_faults_beyond_a_hundred_are_counted() -> None:
    text = "scene: 1\nmesh: {builtin: head}\n" + "".join(f"k{i}: 1\n" for i in range(150))
    with pytest.raises(InputError) as caught:
        validate(load_text(text, "f"), Scene)
    assert len(caught.value.faults) == 101
    assert str(caught.value.faults[-1]) == "f:103:1: from here on 50 faults are not listed"
    assert len(messages("a: 1\n" * 200)) == 101


def test_values_and_keys_in_messages_are_short_and_printable() -> None:
    text = 'scene: "' + "x" * 500 + '"\nmesh: {builtin: head}\n"a\\e[31m\\n": 1\n'
    with pytest.raises(InputError) as caught:
        validate(load_text(text, "f"), Scene)
    assert all(len(fault.message) < 250 and fault.message.isprintable() for fault in caught.value.faults)

"""`skincli presets`: the list, and a preset in full, which is a skin file again."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from skincli import presets, resources
from skincli.scene.paths import load_skin

Run = Callable[..., Result]
NAMES = sorted(path.stem for path in resources.folder("presets").glob("*.yaml"))


def test_the_list_has_a_sentence_each(skincli: Run) -> None:
    lines = skincli("presets").stdout.splitlines()
    assert [line.split()[0] for line in lines] == NAMES
    assert all(line.endswith(".") and len(line.split()) > 4 for line in lines)
    found = json.loads(skincli("presets", "--json").stdout)
    assert found == {name: load_skin(name).skin.about for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_in_full_is_the_same_skin(skincli: Run, tmp_path: Path, name: str) -> None:
    result = skincli("presets", "show", name)
    assert result.exit_code == 0
    (tmp_path / "own.yaml").write_text(result.stdout)
    assert load_skin(str(tmp_path / "own.yaml")).skin == load_skin(name).skin


def test_a_preset_in_full_says_units_and_ranges(skincli: Run) -> None:
    lines = skincli("presets", "show", "human").stdout.splitlines()
    [extent] = [line for line in lines if line.startswith("extent: 100.0  # side of the flat square")]
    assert extent.endswith(", mm [above 0 to 100000]")
    assert any("opacity: 1.0  # how much of the layer shows, 0 to 1" in line for line in lines)
    assert any(line.startswith("  radius_kind: ") and "dmfp" in line for line in lines)
    # Every line but those that open a mapping or a layer says what it is.
    bare = [line for line in lines if "#" not in line]
    assert all(line.lstrip(" -").removesuffix(":").isidentifier() for line in bare), bare


def test_as_json_every_path_can_be_set(skincli: Run) -> None:
    found = json.loads(skincli("presets", "show", "human", "--json").stdout)
    assert found["skin.extent"] == {
        "value": 100.0,
        "description": "side of the flat square on which maps lie when there is no mesh, mm",
        "default": 100.0,
        "exclusiveMinimum": 0,
        "maximum": 100000,
    }
    assert found["skin.optics.radius_kind"]["choices"] == ["mfp", "dmfp", "d"]
    assert found["skin.optics.color"]["maximum"] == 1
    assert all(entry["description"] for entry in found.values())
    paths = [path for path, entry in found.items() if entry["value"] is not None]
    sets = [f"{path}={json.dumps(found[path]['value'])}" for path in paths]
    assert load_skin("human", sets).skin == load_skin("human").skin


def test_an_unknown_preset_is_refused(skincli: Run) -> None:
    result = skincli("presets", "show", "humn")
    assert (result.exit_code, result.stdout) == (3, "")
    known = ", ".join(NAMES)
    assert result.stderr == f"skincli: 'humn' is no preset; did you mean 'human'? There are: {known}\n"


def test_presets_need_neither_layers_nor_opengl_to_be_listed() -> None:
    script = (
        "import sys\nfrom skincli import presets\nassert [presets.about(name) for name in presets.names()]\n"
        "bad = {'moderngl', 'OpenImageIO', 'skincli.layers', 'skincli.gpu'} & set(sys.modules)\nassert not bad, bad"
    )
    root = Path(presets.__file__).parents[1]
    subprocess.run([sys.executable, "-c", script], cwd=root, check=True, timeout=60)

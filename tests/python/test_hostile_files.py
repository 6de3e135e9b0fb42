"""Files that are not what their names say, or mean harm: each ends in one sentence that names the file and the line."""

import gzip
from pathlib import Path

import pytest
from test_urdf import PAIR, ends, tree

import partita as pt
from partita.errors import FileFormatError, MissingFileError

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
URDF = f"""<robot name="r">
<link name="base"/>
{LINK.format("a")}
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
</robot>
"""
MJCF = """<mujoco model="m">
<worldbody><body name="a"><joint name="j" type="hinge"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
</mujoco>
"""
SDF = """<sdf version="1.9"><model name="m">
<link name="a"><inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
<joint name="j" type="revolute"><parent>world</parent><child>a</child><axis/></joint>
</model></sdf>
"""
TOML = """[mechanism]
partita = 1
name = "m"
[[rod]]
name = "rod"
start = [0.0, 0.0, 0.0]
end = [1.0, 0.0, 0.0]
mass = 1.0
[[joint]]
name = "A"
type = "revolute"
parent = "ground"
child = "rod"
point = [0.0, 0.0, 0.0]
"""
TEXTS = {".urdf": URDF, ".mjcf": MJCF, ".sdf": SDF, ".toml": TOML}


def refused(path: Path, words: str, line: int | None = None) -> None:
    with pytest.raises(FileFormatError) as reported:
        pt.load(path)
    message = str(reported.value)
    assert words in message and path.name.rpartition(".")[0] in message, message
    assert message.count(".urdf") + message.count(".mjcf") <= 2 and "\n" not in message, message
    assert reported.value.line == line, message


def put(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


@pytest.mark.parametrize("suffix", TEXTS)
def test_what_is_no_text_of_a_model(suffix: str, tmp_path: Path) -> None:
    if suffix == ".mjcf":
        pytest.importorskip("mujoco")
    text = TEXTS[suffix]
    assert pt.load(put(tmp_path, f"good{suffix}", text)).compile().mobility == 1
    refused(put(tmp_path, f"packed{suffix}", gzip.compress(text.encode())), "compressed by gzip")
    refused(put(tmp_path, f"archive{suffix}", b"PK\x03\x04" + bytes(50)), "zip archive")
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
    refused(put(tmp_path, f"pointer{suffix}", pointer), "Git LFS")
    with pytest.raises(FileFormatError, match="cut"):
        pt.load(put(tmp_path, f"cut{suffix}", text[: len(text) // 2]))
    with pytest.raises(FileFormatError, match="empty"):
        pt.load(put(tmp_path, f"empty{suffix}", ""))
    with pytest.raises(FileFormatError, match="zeros"):
        pt.load(put(tmp_path, f"zeros{suffix}", bytes(1000)))
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(MissingFileError, match="this is a folder"):
        pt.load(tmp_path / f"folder{suffix}")
    marked = pt.load(put(tmp_path, f"marked{suffix}", b"\xef\xbb\xbf" + text.encode()))
    assert marked.compile().mobility == 1


def test_other_encodings(tmp_path: Path) -> None:
    """XML says in which encoding it is; what it does not keep to, and what MuJoCo does not read, is refused."""
    wide = put(tmp_path, "wide.urdf", ('<?xml version="1.0" encoding="utf-16"?>' + URDF).encode("utf-16"))
    assert list(pt.load(wide).joints) == ["j"]
    old = '<?xml version="1.0" encoding="{}"?>' + URDF.replace('"a"', '"\xe9"')
    assert "é" in pt.load(put(tmp_path, "old.urdf", old.format("latin-1").encode("latin-1"))).bodies
    refused(put(tmp_path, "wrong.urdf", old.format("utf-8").encode("latin-1")), "not well-formed", 3)
    refused(put(tmp_path, "odd.urdf", old.format("klingon")), "unknown encoding: klingon", 1)
    pytest.importorskip("mujoco")
    refused(put(tmp_path, "wide.mjcf", MJCF.encode("utf-16")), "not UTF-8")
    refused(put(tmp_path, "wide.toml", TOML.encode("utf-16")), "UTF-8")


NUMBERS = {
    "nan": "finite",
    "-inf": "finite",
    "1e400": "finite",
    "-1": "at least 0",
    "1e300": "above 1e+60",
    "1_000": "not made of numbers",
    "0x10": "not made of numbers",
    "1,5": "not made of numbers",
    "\u0661": "not made of numbers",
    "${mass}": "not made of numbers",
}


@pytest.mark.parametrize("number", NUMBERS)
def test_numbers_that_are_none(number: str, tmp_path: Path) -> None:
    words = NUMBERS[number]
    refused(put(tmp_path, "a.urdf", URDF.replace('mass value="1"', f'mass value="{number}"')), words, 3)
    refused(put(tmp_path, "a.sdf", SDF.replace("<mass>1<", f"<mass>{number}<")), words, 2)


def test_mujoco_is_not_asked_about_what_is_no_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo would write a log file of its own in the working folder."""
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    for old in ('mass="1"', 'pos="0 0 0"'):
        bad = MJCF.replace(old, old.replace("0 0 0", "0 NaN 0").replace('"1"', '"nan"'))
        refused(put(tmp_path, "a.mjcf", bad), "finite numbers", 3)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mjcf"]


def test_what_leads_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    inside, outside = tmp_path / "model", tmp_path / "outside.xml"
    (inside / "meshes").mkdir(parents=True)
    outside.write_text("<mujoco/>", "utf-8")
    try:
        (inside / "link.xml").symlink_to(outside)
        (inside / "meshes" / "link.stl").symlink_to(outside)
    except OSError:
        pytest.skip("no links here")

    def model(more: str) -> Path:
        return put(inside, "a.mjcf", MJCF.replace("<worldbody>", f"\n{more}\n<worldbody>"))

    refused(model('<include file="link.xml"/>'), "a link that leads out of the folder", 3)
    mesh = '<compiler meshdir="meshes"/><asset><mesh name="x" file="link.stl"/></asset>'
    refused(model(mesh), "a link that leads out of the folder", 3)
    refused(model('<include file="none.xml"/>'), '"none.xml", which does not exist', 3)
    refused(model('<include file="a.mjcf"/>'), "are circular", 3)


def test_names_twice_and_joints_onto_themselves(tmp_path: Path) -> None:
    refused(put(tmp_path, "a.urdf", URDF.replace('mass value="1"', 'mass value="1" value="2"')), "duplicate", 3)
    refused(put(tmp_path, "a.urdf", URDF.replace('parent link="base"', 'parent link="a"')), "form a cycle", 4)
    refused(put(tmp_path, "a.sdf", SDF.replace("<parent>world", "<parent>a")), "two different bodies", 3)
    refused(put(tmp_path, "a.toml", TOML + TOML), "duplicate", 15)


def test_a_macro_is_no_robot(tmp_path: Path) -> None:
    """Left out, the links and joints that it stands for would be missing."""
    text = URDF.replace("<link", '<xacro:leg side="left"/>\n<link', 1)
    refused(put(tmp_path, "a.urdf", text.replace("<robot", '<robot xmlns:xacro="x"')), "expanded first", 2)


SIDECARS = {
    "a: &a [x, x]\nb: &b [*a, *a]\nclosed_loop: [*b]\n": ("aliases", 2),
    'a: 1\nclosed_loop: !!python/object/apply:os.system ["true"]\n': ("not YAML", 2),
    "closed_loop: []\nclosed_loop: [[here, there]]\n": ("appears twice", 2),
    "\nclosed_loop: " + 5000 * "[": ("lists nest 33 levels, more than the limit of 32", 2),
    "a: 1\nclosed_loop:\n": ("list of pairs", 2),
    "closed_loop: [[here, there]]\ntype: 6d\n": ("list of 1 words", 2),
    "closed_loop: [[[here], there]]\n": ("closes a loop but is not a link", 1),
    "a: 1\n---\nb: 2\n": ("another document", 2),
    "\ngravity: [.nan, 0, 0]\n": ("three finite numbers", 2),
    "\tclosed_loop: []\n": ("not YAML", 1),
    "42\n": ("contains no keys", None),
    "": ("contains no keys", None),
}


@pytest.mark.parametrize("text", SIDECARS)
def test_a_hostile_sidecar(text: str, tmp_path: Path) -> None:
    path = put(tmp_path, "robot.urdf", tree(ends("here", "there")))
    put(tmp_path, "robot.yaml", PAIR)
    assert pt.load(path).compile().mobility == 1
    put(tmp_path, "robot.yaml", text)
    refused(path, *SIDECARS[text])


def test_a_hundred_thousand_keys_and_tables_without_end(tmp_path: Path) -> None:
    keys = "".join(f"k{i} = {i}\n" for i in range(100_000))
    refused(put(tmp_path, "a.toml", TOML + keys), '"k0" is not a key', 15)
    for deep in (f"a = {10_000 * '['}", f"[{'.'.join(5_000 * 'a')}]"):
        with pytest.raises(FileFormatError, match="recur") as caught:
            pt.load(put(tmp_path, "a.toml", f"# deep\n{deep}"))
        assert caught.value.line == 2
    deep_xml = f'<robot name="r">{10_000 * "<x>"}'
    refused(put(tmp_path, "a.urdf", deep_xml), "elements nest 513 levels, more than the limit of 512", 1)


def test_faults_that_other_readers_overlook(tmp_path: Path) -> None:
    """-- in comments, and lines before the declaration; what is wrong otherwise is in its own line."""
    comment = "<!-- a -- b\n<link name='c'/> -->"
    text = f"\n<?xml version='1.0'?>\n{comment}\n{URDF}"
    assert pt.load(put(tmp_path, "a.urdf", text)).compile().mobility == 1
    refused(put(tmp_path, "a.urdf", text.replace('mass value="1"', 'mass value="x"')), "not made of numbers", 7)
    refused(put(tmp_path, "a.urdf", text.replace("</robot>", "</robots>")), "not well-formed", 2)
    pytest.importorskip("mujoco")
    hidden = MJCF.replace("<worldbody>", f"{comment}<include file='/etc/hosts'/><worldbody>")
    refused(put(tmp_path, "a.mjcf", hidden), "leads out of the folder", 3)
    # a comment is none in CDATA, so nothing is taken out of a file that has some
    hidden = hidden.replace("<include", "<![CDATA[<!--]]><include").replace("hosts'/>", "hosts'/><![CDATA[-->]]>")
    refused(put(tmp_path, "a.mjcf", hidden), "not well-formed", 2)

"""No file that the packages read can run code: an AST test over every module.

What runs code by intention (a policy that the user names, an entry point of an installed package) stands in
`ALLOWED` with its reason; SECURITY.md says the same to users.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("guidance", "hda", "rl", "studies", "examples")

BANNED_MODULES = {
    "_pickle", "cloudpickle", "cPickle", "dbm", "dill", "hickle", "joblib", "jsonpickle", "klepto", "marshal",
    "pickle", "pickletools", "shelve", "yaml",
}  # fmt: skip
BANNED_BUILTINS = {"__import__", "compile", "eval", "exec"}
BANNED_NAMES = {
    "code.interact", "ctypes.CDLL", "ctypes.cdll", "importlib.import_module",
    "gymnasium.envs.registration.EnvSpec.from_json", "importlib.util.spec_from_file_location",
    "numpy.lib.format.read_array", "os.execv", "os.popen", "os.system", "pandas.eval", "pandas.read_hdf",
    "pandas.read_pickle", "pty.spawn", "runpy.run_module", "runpy.run_path", "subprocess.getoutput",
    "subprocess.getstatusoutput", "torch.hub.load", "torch.jit.load", "torch.load", "torch.package",
    "torch.serialization.load", "torch.utils.model_zoo",
}  # fmt: skip
BANNED_ATTRIBUTES = {
    "load_replay_buffer",
    "recover_environment",
    "read_pickle",
    "read_hdf",
    "to_pickle",
    "save_replay_buffer",
    "unsafe_load",
}
NEEDS_ALLOW_PICKLE_FALSE = {"numpy.load", "numpy.save"}
AGENT_LIBRARIES = ("stable_baselines3.", "sb3_contrib.")  # their load() unpickles

ALLOWED: dict[tuple[str, str], str] = {
    ("guidance/convex/clarabel_solver.py", "importlib.import_module"): "a dependency, by a fixed name",
    ("guidance/exports.py", "importlib.import_module"): "modules of these packages, by fixed names",
    ("hda/registry.py", "importlib.import_module"): "the policy that the user names: package.module:Name",
    ("hda/registry.py", ".load() of an entry point"): "policies of installed packages",
    ("rl/dataset/minari_file.py", "importlib.import_module"): "an optional library, by a fixed name",
    ("studies/launcher.py", "importlib.import_module"): "commands of these packages, by fixed names",
    ("hda/flight/film.py", "importlib.import_module"): "the agents, by a fixed name, as an entry point would",
    ("studies/timing/gfold_peer.py", "importlib.import_module"): "an optional peer, by a fixed name",
    ("studies/timing/openscvx_worker.py", "importlib.import_module"): "an optional peer, by a fixed name",
    ("studies/rigid_plans/openscvx_body_worker.py", "importlib.import_module"): "that peer for bodies",
    ("studies/timing/qoco_peer.py", "importlib.import_module"): "an optional peer, by a fixed name",
}  # fmt: skip


def dotted(node: ast.expr, names: dict[str, str]) -> str:
    """`np.load` -> numpy.load, by the module's own imports; empty where it is no dotted name."""
    if isinstance(node, ast.Name):
        return names.get(node.id, node.id)
    if isinstance(node, ast.Attribute):
        before = dotted(node.value, names)
        return f"{before}.{node.attr}" if before else ""
    return ""


def imported(tree: ast.Module) -> tuple[dict[str, str], list[tuple[int, str]]]:
    """Local name -> dotted name of every import, and the banned ones."""
    names: dict[str, str] = {}
    dangers = []
    for node in ast.walk(tree):
        whole: list[str] = []
        if isinstance(node, ast.Import):
            whole = [entry.name for entry in node.names]
            for entry in node.names:
                names[entry.asname or entry.name.partition(".")[0]] = (
                    entry.name if entry.asname else entry.name.partition(".")[0]
                )
        elif isinstance(node, ast.ImportFrom):
            whole = [f"{node.module}.{entry.name}" for entry in node.names]
            names.update({entry.asname or entry.name: f"{node.module}.{entry.name}" for entry in node.names})
        dangers += [(node.lineno, name) for name in whole if name.partition(".")[0] in BANNED_MODULES]  # type: ignore[attr-defined]
    return names, dangers


def is_false(call: ast.Call, keyword: str) -> bool:
    return any(
        k.arg == keyword and isinstance(k.value, ast.Constant) and k.value.value is False
        for k in call.keywords
    )


def call_dangers(node: ast.Call, names: dict[str, str]) -> Iterator[str]:
    called = dotted(node.func, names)
    if called in NEEDS_ALLOW_PICKLE_FALSE and not is_false(node, "allow_pickle"):
        yield f"{called} without allow_pickle=False"
    for keyword in node.keywords:
        if keyword.arg == "shell" and not is_false(node, "shell"):
            yield "shell=True"
        if keyword.arg == "allow_pickle" and not is_false(node, "allow_pickle"):
            yield "allow_pickle=True"
    if called.startswith(AGENT_LIBRARIES) and called.endswith(
        (".load", ".set_parameters", "load_from_zip_file")
    ):
        yield called
    if (
        isinstance(node.func, ast.Attribute)
        and node.func.attr == "load"
        and not node.args
        and not node.keywords
    ):
        yield ".load() of an entry point"


def find_dangers(source: str) -> list[tuple[int, str]]:
    """(line, what) of everything in a module that may run code from data."""
    tree = ast.parse(source)
    names, dangers = imported(tree)
    called_functions = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            dangers += [(node.lineno, what) for what in call_dangers(node, names)]
        if isinstance(node, ast.Name | ast.Attribute):
            name = dotted(node, names)
            if name in BANNED_NAMES or (isinstance(node, ast.Name) and name in BANNED_BUILTINS):
                dangers.append((node.lineno, name))
            if name in NEEDS_ALLOW_PICKLE_FALSE and id(node) not in called_functions:
                dangers.append((node.lineno, f"{name} handed on"))
        if isinstance(node, ast.Attribute) and node.attr in BANNED_ATTRIBUTES:
            dangers.append((node.lineno, node.attr))
    return sorted(set(dangers))


@pytest.mark.parametrize("package", PACKAGES)
def test_nothing_that_is_read_can_run_code(package: str) -> None:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files
    found = [
        f"{name}:{line}: {what}"
        for file in files
        for name in [file.relative_to(ROOT).as_posix()]
        for line, what in find_dangers(file.read_text())
        if (name, what) not in ALLOWED
    ]
    assert found == []


def test_every_exception_is_still_needed() -> None:
    for name, what in ALLOWED:
        assert what in {found for _, found in find_dangers((ROOT / name).read_text())}, (name, what)


def test_every_package_is_looked_at() -> None:
    tops = {file.parent.name for file in ROOT.glob("*/__init__.py")} - {"tests"}
    assert tops <= set(PACKAGES)


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "import pickle as fine",
        "from pickle import loads",
        "from joblib import load",
        "import yaml",
        "import torch\ntorch.load('x')",
        "import torch as t\nread = t.load",
        "from torch import load\nload('x')",
        "import numpy as np\nnp.load('x')",
        "import numpy as np\nnp.load('x', allow_pickle=True)",
        "import numpy as np\nflag = False\nnp.load('x', allow_pickle=flag)",
        "from numpy import load as read\nread('x')",
        "import numpy as np\nread = np.load",
        "import numpy as np\nnp.save('x', y)",
        "eval('1')",
        "f = exec",
        "compile('1', 'x', 'eval')",
        "import subprocess\nsubprocess.run('ls', shell=True)",
        "import os\nos.system('ls')",
        "import pandas as pd\npd.read_pickle('x')",
        "frame.to_pickle('x')",
        "from stable_baselines3 import TD3\nTD3.load('x')",
        "from stable_baselines3.common.save_util import load_from_zip_file\nload_from_zip_file('x')",
        "model.load_replay_buffer('x')",
        "dataset.recover_environment()",
        "from gymnasium.envs.registration import EnvSpec\nEnvSpec.from_json('{}')",
        "import importlib\nimportlib.import_module(name)",
        "def read(point):\n    return point.load()",
    ],
)
def test_the_search_finds(source: str) -> None:
    assert find_dangers(source)


@pytest.mark.parametrize(
    "source",
    [
        "import numpy as np\nnp.load('x', allow_pickle=False)",
        "import json\njson.loads('1')",
        "import re\nre.compile('x')",
        "import subprocess\nsubprocess.run(['ls'], shell=False)",
        "from safetensors.numpy import load\nload(b'')",
    ],
)
def test_the_search_leaves_alone(source: str) -> None:
    assert find_dangers(source) == []

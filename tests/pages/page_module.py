"""Modules of the page without a page: node runs a function on many arguments; the test is skipped without node."""

from __future__ import annotations

import json
import shutil
import subprocess

import pytest

from collide.pages.page_file import VIEWER

_SCRIPT = """
const asked = JSON.parse(require("node:fs").readFileSync(0, "utf8"));
import(asked.place).then((module) => {
  const answers = asked.arguments.map((each) => asked.run ? new Function("module", "each", asked.run)(module, each)
    : module[asked.name](...each));
  process.stdout.write(JSON.stringify(answers));
});
"""


def call(module: str, name: str, arguments: list, run: str = "") -> list:
    """What a function of a module of the page returns for each list of arguments.

    run : the body of a function of `module` and `each`, asked in the place of ``name``.
    """
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node here: apt-get install nodejs")
    place = (VIEWER / "source" / f"{module}.js").as_uri()
    asked = {"place": place, "name": name, "arguments": arguments, "run": run}
    done = subprocess.run(
        [node, "-e", _SCRIPT], input=json.dumps(asked), capture_output=True, text=True, timeout=60, check=True
    )
    return json.loads(done.stdout)

"""Imports point down: the contract in pyproject.toml, enforced."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def lint(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [
        sys.executable,
        "-c",
        "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(no_logo=True))",
    ]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )


def test_imports_point_down():
    result = lint(ROOT)
    assert result.returncode == 0, result.stdout
    assert "1 kept, 0 broken" in result.stdout


def test_the_contract_would_notice(tmp_path):
    package = tmp_path / "upside"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "high.py").write_text("")
    (package / "low.py").write_text("def late():\n    import upside.high\n")
    (tmp_path / ".importlinter").write_text(
        "[importlinter]\nroot_package = upside\n\n[importlinter:contract:1]\nname = down\ntype = layers\n"
        "containers = upside\nexhaustive = true\nlayers =\n    high\n    low\n"
    )
    result = lint(tmp_path, PYTHONPATH=str(tmp_path))
    assert result.returncode != 0 and "upside.low" in result.stdout


@pytest.mark.parametrize(
    "arguments", [["--help"], ["list"], ["denoise", "--help"], ["fit", "--help"], ["tables", "--help"], ["--version"]]
)
def test_help_and_list_stay_light(arguments):
    code = (
        "import sys\nfrom n2n.cli.main import main\n"
        f"try:\n    main({arguments!r})\nexcept SystemExit:\n    pass\n"
        "heavy = {'torch', 'lightning', 'hydra', 'numpy', 'scipy', 'trimesh', 'rich'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert result.stdout


def test_importing_the_package_is_light():
    code = "import n2n, sys\nassert not {'torch', 'numpy'} & set(sys.modules)\nn2n.Field\nassert 'torch' in sys.modules"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

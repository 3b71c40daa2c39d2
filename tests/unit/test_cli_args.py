"""The command line's own part, with a stand-in for the renderer: arguments, messages, exit codes, what is printed."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import PIL.Image
import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.cli import certificates
from wgpu_gi.cli import common as cli_common
from wgpu_gi.cli import info as cli_info
from wgpu_gi.cli import messages as cli_messages
from wgpu_gi.cli import render as cli_render
from wgpu_gi.cli.interrupt import handled, held, interruptible
from wgpu_gi.cli.messages import Messages
from wgpu_gi.errors import GiError
from wgpu_gi.pictures.image import load_image
from wgpu_gi.scene.scene import DirectionalLight, Scene
from wgpu_gi.sequence import source

DEFAULTS = ("many-light", None, 64, 0, False)  # gi, bounces, spp, seed, diffuse


class FakeRenderer:
    """Makes a grey picture and remembers what it was asked."""

    adapter_name, is_cpu = "a fake", True
    interrupt: type[BaseException] | None = None
    before_interrupt = 0  # frames finished before it

    def __init__(self, scene, **arguments):
        FakeRenderer.made = self
        self.scene, self.arguments = scene, arguments
        self.size, self.settings, self.finished = arguments["size"], arguments["settings"], 0

    def run(self, progress, *, show, check, timings):
        self.ran = (show, check, timings)
        progress(0.5)
        self.finished = self.before_interrupt
        if self.interrupt is not None:
            raise self.interrupt()
        settings = self.settings
        self.finished = settings.spp if settings.gi == "path" else settings.camera.frames

    def read_back(self, name):
        width, height = self.size
        return np.full((height, width) if name == "depth" else (height, width, 3), 0.5, np.float32)

    def plan(self):
        return "THE PLAN"

    def timings(self):
        return "THE TIMINGS"


def fake_load(name, environment, lights, max_memory=None, strict=False, point_size=None, time=None):
    return Scene(name=name, environment=environment, lights=list(lights), notes=["a remark"])


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli_common, "Renderer", FakeRenderer)
    monkeypatch.setattr(source, "read_scene", fake_load)
    monkeypatch.setattr(cli_common, "choose_camera", lambda scene, selector, folder: f"camera {selector}")
    monkeypatch.setattr(FakeRenderer, "interrupt", None)


def test_defaults(capsys, tmp_path):
    assert main(["render"]) == 0
    made = FakeRenderer.made
    assert made.scene.name == "cornell"
    assert made.arguments["size"] == (640, 360)
    assert made.arguments["camera"] == "camera None"
    assert made.arguments["adapter"] is None
    settings = made.arguments["settings"]
    assert (settings.gi, settings.bounces, settings.spp, settings.seed, settings.diffuse) == DEFAULTS
    assert made.ran == (("radiance",), False, False)
    printed = capsys.readouterr()
    assert printed.out.startswith("out.png: 640x360, 24 frames, exposure -1.5 EV (automatic), ")
    assert printed.out.endswith(" s on a fake\n")
    assert "note: a remark\n" in printed.err
    assert "a fake is a CPU" in printed.err
    assert (tmp_path / "out.png").stat().st_size > 0


def test_arguments_reach_the_renderer(capsys):
    arguments = "render s.glb -o o.exr --size 32x18 --camera front --gi none --bounces 3 --spp 2 --env 1,2,3 --seed 9"
    more = ["--light", "sun 0,-1,0 1,1,1", "--light", "sun 1,-1,0 1,1,1", "--show", "radiance", "--show", "depth"]
    flags = "--set camera.jitter=false --adapter lavapipe --plan --timings --check --diffuse --exposure -1.5"
    assert main([*arguments.split(), *more, *flags.split()]) == 0
    made = FakeRenderer.made
    assert made.arguments["camera"] == "camera front"
    assert made.arguments["adapter"] == "lavapipe"
    assert made.ran == (("radiance", "depth"), True, True)
    assert made.scene.environment.color == (1.0, 2.0, 3.0)
    assert [type(light) for light in made.scene.lights] == [DirectionalLight, DirectionalLight]
    settings = made.arguments["settings"]
    assert (settings.gi, settings.bounces, settings.spp, settings.seed, settings.diffuse) == ("none", 3, 2, 9, True)
    assert settings.camera.jitter is False
    printed = capsys.readouterr().out
    assert "THE PLAN" in printed
    assert "THE TIMINGS" in printed
    assert load_image("o.exr", "depth").shape == (18, 32)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--gi none --bounces 2", ["--gi none has at most 0 indirect bounces, not 2"]),
        ("--gi ssil --bounces 17", ["--gi ssil has at most 16 indirect bounces, not 17"]),
        ("--gi none --set bounces=1", ["--gi none has at most 0 indirect bounces, not 1"]),
        ("--gi none --spp 7", ["--spp changes nothing: --gi none averages frames, set by camera.frames"]),
        ("--gi none --bounces 0", []),
        ("--gi none --bounces unlimited", []),
        ("--gi path --bounces 2 --spp 7", []),
        ("--gi none --visible-only", ["--visible-only changes nothing: --gi none does not use it"]),
        ("--gi none --seed 3", []),
        (
            "--gi path --set camera.frames=3",
            ["camera.frames changes nothing: --gi path averages samples, set by --spp"],
        ),
        ("--gi none --set vpl.count=512", ["vpl.count changes nothing: --gi none does not use it"]),
        ("--gi ssil --set vpl.count=512 --set ssil.levels=3", ["vpl.count changes nothing: --gi ssil does not use it"]),
        ("--set vpl.count=512 --seed 3 --set exposure=1", []),
    ],
)
def test_settings_without_effect_are_noted(arguments, words, capsys):
    assert main(["render", *arguments.split()]) == 0
    notes = [line for line in capsys.readouterr().err.splitlines() if line.startswith("note: ")]
    assert notes == ["note: a remark", *(f"note: {text}" for text in words)]


FLAGS_OF_RENDER = ("--gi", "--quality", "--bounces", "--spp", "--seed", "--set", "--size", "--exposure")
FLAGS_OF_RENDER += ("--max-memory", "-o", "--show", "--frames", "--shard", "--fps", "--env", "--light", "--relight")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("", "required"),
        ("paint", "invalid choice"),
        ("render --nonsense", "unrecognized arguments: --nonsense"),
        ("render a.glb b.glb", "unrecognized arguments: b.glb"),
        ("render --size 640", "WIDTHxHEIGHT"),
        ("render --size -1x5", "--size"),
        ("render --size 0x0", "0x0"),
        ("render --size 100000x100000", "100000x100000"),
        ("render --size 99999999999x1", "WIDTHxHEIGHT"),
        ("render --gi magic", "not 'magic'"),
        ("render --bounces -1", "--bounces"),
        ("render --bounces many", "0, 1, 2 ... or unlimited"),
        ("render --spp 0", "spp"),
        ("render --spp two", "--spp"),
        ("render --seed -1", "seed"),
        ("render --exposure nan", "--exposure"),
        ("render --exposure bright", "--exposure"),
        ("render --env 1,nan,1", "radiance must be finite and not negative"),
        ("render --env 1,-1,1", "radiance must be finite and not negative"),
        ("render --env missing.hdr", "missing.hdr"),
        ("render --light sun", "sun"),
        ("render --relight 3=1,1,1", "there is no light '3'; this scene has none"),
        ("render --show beauty", "--gi many-light has no buffer 'beauty'; did you mean "),
        ("render --set camera.jitter", "section.name=value"),
        ("render --set camera.shake=1", "no setting 'camera.shake'"),
        ("render --set camera.jitter=maybe", "true or false"),
        ("render -o out.tiff", "unknown picture format"),
        ("render -o missing/out.png", "there is no folder missing"),
        ("render -o .", "unknown picture format"),
        ("render -o out.png --show radiance --show depth", "holds one buffer"),
        ("render -o a\0b.png", "NUL"),
        ("render --max-memory 0", "--max-memory"),
        ("render --max-memory lots", "memory is a number of GiB above 0"),
        ("bench --max-memory nan", "--max-memory"),
        ("render --light point\u00a01,1,1\u00a01e39,1,1", "a light cannot be negative or above 1e+20"),
        *((f"render {flag} {'9' * 5000}", "9...") for flag in (*FLAGS_OF_RENDER, "")),
        *((f"render {flag} \x1b[31m\v\u2028x", r"\x1b[31m") for flag in ("--gi", "--size", "--env", "-o")),
    ],
)
def test_bad_arguments_are_one_sentence_and_exit_code_2(arguments, words, capsys, tmp_path):
    assert main([word.replace("\u00a0", " ") for word in arguments.split(" ")] if arguments else []) == 2
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.err.startswith("wgpu-gi: error: ")
    assert len(printed.err.splitlines()) == 1 and len(printed.err) < 800
    assert printed.out == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (GiError, 2, "wgpu-gi: error: "),
        (MemoryError, 2, "not enough memory"),
        (KeyboardInterrupt, 130, "interrupted; no file was left half-written"),
    ],
)
def test_failure_while_rendering_leaves_no_file(error, code, words, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(FakeRenderer, "interrupt", error)
    assert main(["render", "--size", "8x8"]) == code
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("arguments", "words"), [("", "7 of 24 frames"), ("--gi path --spp 99", "7 of 99 spp")])
@pytest.mark.parametrize("certified", [True, False])
def test_interrupted_picture_is_saved(arguments, words, certified, monkeypatch, capsys):
    """With its certificate, unless Ctrl-C comes again."""

    def certify(*_, **__):
        if not certified:
            raise KeyboardInterrupt
        return SimpleNamespace(sentence=lambda: "relMSE 1", texts=lambda: {"certificate": "relMSE 1"})

    monkeypatch.setattr(certificates, "certify", certify)
    monkeypatch.setattr(FakeRenderer, "interrupt", KeyboardInterrupt)
    monkeypatch.setattr(FakeRenderer, "before_interrupt", 7)
    assert main(["render", "--size", "8x8", *arguments.split()]) == 130
    printed = capsys.readouterr()
    assert f"out.png: 8x8, {words}, " in printed.out and ("relMSE 1" in printed.out) == certified
    assert printed.err.endswith(f"wgpu-gi: interrupted; out.png holds the picture so far, {words}\n")
    with PIL.Image.open("out.png") as picture:
        assert picture.text["interrupted"] == words
        assert picture.text.get("certificate") == ("relMSE 1" if certified else None)


def test_terminated_picture_is_saved_without_a_certificate(monkeypatch, capsys):
    """A farm manager that ends a task kills it soon after."""
    monkeypatch.setattr(certificates, "certify", None)
    ended = staticmethod(lambda: (signal.raise_signal(signal.SIGTERM), KeyboardInterrupt())[1])
    monkeypatch.setattr(FakeRenderer, "interrupt", ended)
    monkeypatch.setattr(FakeRenderer, "before_interrupt", 7)
    assert main(["render", "--size", "8x8"]) == 143
    assert "out.png holds the picture so far, 7 of 24 frames" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    with PIL.Image.open("out.png") as picture:
        assert "certificate" not in picture.text


@pytest.mark.usefixtures("taking_interrupts")
@pytest.mark.parametrize("step", ["read_pictures", "save_layers"])
def test_interrupted_picture_is_saved_however_often_it_is_interrupted(step, monkeypatch, capsys):
    own = getattr(cli_render, step)

    def interrupted(*arguments, **named):
        signal.raise_signal(signal.SIGINT)
        return own(*arguments, **named)

    monkeypatch.setattr(cli_render, step, interrupted)
    monkeypatch.setattr(certificates, "certify", lambda *_, **__: signal.raise_signal(signal.SIGINT))
    monkeypatch.setattr(FakeRenderer, "interrupt", KeyboardInterrupt)
    monkeypatch.setattr(FakeRenderer, "before_interrupt", 7)
    assert main(["render", "--size", "8x8"]) == 130
    printed = capsys.readouterr()
    assert "no certificate: interrupted" in printed.err and "no file was left" not in printed.err
    with PIL.Image.open("out.png") as picture:
        assert picture.text["interrupted"] == "7 of 24 frames"


def test_programming_errors_are_not_caught(monkeypatch):
    monkeypatch.setattr(FakeRenderer, "interrupt", ZeroDivisionError)
    with pytest.raises(ZeroDivisionError):
        main(["render", "--size", "8x8"])


@pytest.mark.parametrize(
    ("flag", "words"), [("--set", "camera.jitter="), ("--show", "radiance\ndirect\n"), ("--gi", "path   ")]
)
def test_help_lists_settings_buffers_and_techniques(flag, words, capsys, tmp_path):
    assert main(["render", flag, "help"]) == 0
    assert words in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("arguments", [["-h"], ["render", "-h"], ["info", "-h"], ["--version"]])
def test_help(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 0
    assert "wgpu" in capsys.readouterr().out


def test_exposure_applies_to_displayed_light_only(capsys):
    for arguments, words, text in (
        ("-o a.png", "exposure -1.5 EV (automatic)", "-1.5 EV (automatic)"),
        ("-o a.png --exposure automatic", "exposure -1.5 EV (automatic)", "-1.5 EV (automatic)"),
        ("-o a.png --exposure 2.25", "exposure +2.25 EV, ", "+2.25 EV"),
        ("-o a.png --set exposure=1", "exposure +1 EV, ", "+1 EV"),
        ("-o a.png --show normal", "", None),
        ("-o a.exr", "", None),
        ("-o a.exr --exposure 2", "", None),
    ):
        assert main(["render", "--size", "8x8", *arguments.split()]) == 0
        printed = capsys.readouterr().out
        assert words in printed
        assert ("exposure" in printed) == bool(words)
        if arguments.startswith("-o a.png"):
            with PIL.Image.open("a.png") as picture:
                assert picture.text.get("exposure") == text
        else:
            assert np.all(load_image("a.exr") == 0.5)


def test_quiet_and_verbose(capsys):
    assert main(["render", "--size", "8x8", "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main(["render", "--size", "8x8", "-q", "--timings"]) == 0
    assert capsys.readouterr() == ("THE TIMINGS\n", "")
    assert main(["render", "--size", "8x8", "-v"]) == 0
    assert "cornell: 0 triangles, 0 instances, 0 lights" in capsys.readouterr().err
    assert main(["render", "-q", "-v"]) == 2


def test_progress_bar_appears_only_on_a_terminal_and_after_a_delay(monkeypatch, capsys):
    with Messages().progress("rendering") as report:
        report(0.5)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(cli_messages, "LINE_SECONDS", 0.0)
    with Messages().progress("rendering") as report:
        report(0.5)
    assert capsys.readouterr().err.startswith("rendering: 50% 0:0")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with Messages().progress("rendering") as report:
        report(1.0)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(cli_messages, "BAR_SECONDS", 0.0)
    with Messages().progress("rendering") as report:
        for _ in range(20):
            time.sleep(0.02)
            report(0.25)
    printed = capsys.readouterr().err
    assert "rendering" in printed
    assert "25%" in printed
    assert "left" in printed
    with Messages(quiet=True).progress("rendering") as report:
        time.sleep(0.05)
        report(0.5)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("seconds", "fraction", "words"),
    [(0.0, 0.0, ""), (10.0, 0.5, "0:10 left"), (3.0, 0.01, "4:57 left"), (60.0, 0.005, "3 h 19 min left")],
)
def test_time_left(seconds, fraction, words):
    assert cli_messages._time_left(seconds, fraction) == words


def test_closed_pipe_ends_the_command_quietly():
    process = subprocess.Popen(
        [sys.executable, "-m", "wgpu_gi", "render", "--set", "help=all"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    process.stdout.close()
    assert process.wait() == 141
    assert process.stderr.read() == b""


@pytest.fixture
def taking_interrupts():
    """A process in the background of a shell ignores them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("taking_interrupts")
@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize("quiet", [True, False])
def test_interrupt_swallowed_by_a_callback_is_raised_again(terminal, quiet, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    with pytest.raises(KeyboardInterrupt), interruptible(), Messages(quiet=quiet).progress("rendering") as report:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        report(0.5)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with Messages(quiet=quiet).progress("rendering") as report:
        report(0.5)


@pytest.mark.usefixtures("taking_interrupts")
def test_interrupt_waits_for_imports():
    with interruptible():
        with pytest.raises(KeyboardInterrupt), held():
            signal.raise_signal(signal.SIGINT)
            finished = True
        assert finished


@pytest.mark.usefixtures("taking_interrupts")
def test_interrupt_waits_while_there_is_a_picture_to_save():
    pictures = 0
    with interruptible(), pytest.raises(KeyboardInterrupt), held(lambda: pictures > 0):
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        handled()
        pictures = 1
        signal.raise_signal(signal.SIGINT)
        pictures = 2
    assert pictures == 2


@pytest.mark.usefixtures("taking_interrupts")
@pytest.mark.parametrize("error", [ImportError("a C module"), GiError("a file"), MemoryError(), ZeroDivisionError()])
def test_error_that_an_interrupt_became_is_an_interrupt(error, monkeypatch, capsys):
    """numpy's import, for example, ends with ImportError."""

    def fail(_):
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise error

    monkeypatch.setattr(cli_info, "info", fail)
    assert main(["info"]) == 130
    assert capsys.readouterr().err == "wgpu-gi: interrupted; no file was left half-written\n"


def adapter(**changes):
    values = {
        "name": "a card", "backend": "Vulkan", "type": "DiscreteGPU", "driver": "1.2", "features": ("timestamp-query",),
        "limits": {"max-buffer-size": 7}, "usable": True, "why_not": "", "needs_newer_driver": (),
    }  # fmt: skip
    return SimpleNamespace(**{**values, **changes})


def test_info_names_what_will_be_used(monkeypatch, capsys):
    bad = adapter(name="an old card", usable=False, why_not="it is too old")
    old = adapter(name="llvmpipe", type="CPU", needs_newer_driver=("right times",))
    monkeypatch.setattr(cli_info, "list_adapters", lambda: [adapter(), old, bad])
    assert main(["info"]) == 0
    printed = capsys.readouterr().out
    assert "needs a newer driver: right times" in printed
    assert "a card: Vulkan, DiscreteGPU, 1.2: will be used" in printed
    assert "llvmpipe: Vulkan, CPU, 1.2: can be used with --adapter" in printed
    assert "this is a CPU" in printed
    assert "it is too old" in printed
    assert "max-buffer-size 7" in printed
    assert "timestamp-query" in printed and "timestamp-query: absent" not in printed
    assert "float32-filterable: absent; 32-bit float textures cannot be filtered" in " ".join(printed.split())
    assert "numpy " in printed


@pytest.mark.parametrize("adapters", [[], [adapter(usable=False, why_not="OpenGL only")]])
def test_info_without_adapter_says_what_to_install(adapters, monkeypatch, capsys):
    monkeypatch.setattr(cli_info, "list_adapters", lambda: adapters)
    assert main(["info"]) == 2
    assert "apt-get install mesa-vulkan-drivers libvulkan1" in " ".join(capsys.readouterr().out.split())


def test_import_and_help_load_no_heavy_module():
    code = (
        "import sys, wgpu_gi.__main__, wgpu_gi.cli.arguments as m\n"
        "m.build_parser().format_help()\n"
        "print(*[n for n in ('numpy', 'wgpu', 'mapbox_earcut', 'PIL', 'OpenEXR', 'rich') if n in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == ""


def test_public_names_exist():
    import wgpu_gi

    for name in wgpu_gi.__all__:
        assert getattr(wgpu_gi, name) is not None
    assert set(wgpu_gi.__all__) <= set(dir(wgpu_gi))
    with pytest.raises(AttributeError):
        wgpu_gi.nonsense  # noqa: B018

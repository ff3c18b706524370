"""Campaign: two or three of one study in one folder at once, or of one picture in one file."""

import time

from tests.torture import judge, study
from tests.torture.case import DONE, INTERRUPTED, REFUSED, Fault
from tests.torture.processes import Command

LIMIT_S = 240.0
REFUSES = "another study writes to"


def prepare(_name):
    study.expected()


def play(case):
    return case.rng.choice((_same_study, _same_study, _same_study, _same_file))(case)


def _started(case, line, commands):
    """Start commands a random moment apart."""
    for _ in range(case.rng.choice((2, 2, 3))):
        time.sleep(case.rng.choice((0.0, 0.0, case.rng.uniform(0, 2.5))))
        commands.append(Command(line, case.folder))
    case.tell(f"{len(commands)} x care-sim {' '.join(line)}")


def _same_study(case):
    out, commands = case.folder / "out", []
    try:
        _started(case, study.command("out", case.rng.choice((1, 2))), commands)
        _watched(commands, out)
        endings = [_ending(command) for command in commands]
        for command in commands:
            command.check_gone()
    finally:
        for command in commands:
            command.__exit__()
    case.tell(f"endings {endings}")
    if DONE not in endings or set(endings) - {DONE, REFUSED}:
        raise Fault("of several writers not one came to an end", str(endings))
    study.check_whole(out)
    return DONE


def _watched(commands, out):
    """Read what is there while they write: it is whole whenever it is."""
    while any(command.process.poll() is None for command in commands):
        if out.exists():
            study.check_not_torn(out)
        time.sleep(0.05)
        if time.monotonic() - commands[0].started > 120:
            raise Fault(
                "hang", "\n".join(command.stacks() for command in commands), "several writers"
            )


def _ending(command):
    code = command.wait(60)
    out, err = command.said()
    ended = judge.ending(code, out, err, command.arguments)
    if ended == REFUSED and REFUSES not in err:
        raise Fault("a writer that is refused for another reason", err)
    return ended


def _same_file(case):
    name = case.rng.choice(("x.gif", "x.webp", "x.png", "x.rrd"))
    option = {"gif": "--video", "webp": "--video", "png": "--video", "rrd": "--record"}[
        name.split(".")[1]
    ]
    commands = []
    try:
        _started(
            case,
            ["run", "dartout", option, name, "--scenario-parameters", "duration_s=0.6"],
            commands,
        )
        endings = [
            judge.ending(command.wait(60), *command.said(), command.arguments)
            for command in commands
        ]
    finally:
        for command in commands:
            command.__exit__()
    case.tell(f"endings {endings}")
    if DONE not in endings or INTERRUPTED in endings:
        raise Fault("of several writers not one came to an end", str(endings))
    check_file(case.folder / name)
    return DONE


def check_file(path):
    """A fault for a picture or a recording that is not whole."""
    from PIL import Image, ImageSequence

    if path.suffix == ".rrd":
        from rerun.chunk import RrdReader

        RrdReader(str(path)).stream().to_chunks()
        return
    if path.suffix in (".html", ".md", ".json"):
        if not path.read_text().rstrip().endswith(("</html>", "}", "]")):
            raise Fault("a file torn", path.read_text()[-200:], path.suffix)
        return
    if path.suffix == ".mp4":
        if b"moov" not in path.read_bytes():
            raise Fault("a file torn", "an MP4 without an index", path.suffix)
        return
    try:
        with Image.open(path) as image:
            for frame in ImageSequence.Iterator(image):
                frame.load()
    except Exception as error:
        raise Fault("a file torn", f"{path.name}: {error}", path.suffix) from error

#!/usr/bin/env python3
"""The page of a proof: what README and docs say of the headset, row by row, and what android/prove.sh found of it.

    android/prove-page.py FOLDER

Reads what android/prove.sh has left in FOLDER, writes proof.html there and prints the rows. Each claim is quoted from the page that makes it, and figures
are taken from the quotation: a claim that is no longer made is an error here. The exit status is 1 where a claim did not hold, or none did, 2 where a quotation is gone.
"""

import html
import json
import re
import sys
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
HELD, BROKE, UNTRIED = "held", "did not hold", "not tried"
RATES = (72, 80, 90, 120)
# From where Android's levels of heat are felt: "severe".
SEVERE = 3
# Of the display's rate: what is still taken for it.
RATE_KEPT = 0.95
# Of the app's memory, kB and a share: what a call may add.
GROWTH_KB, GROWTH_SHARE = 12_000, 0.03


class Untried(Exception):
    """Why a claim was not judged."""


class Found:
    """What a proof left."""

    def __init__(self, folder):
        self.folder = folder
        lines = self.text("device.txt").splitlines()
        self.device = dict(line.split("=", 1) for line in lines if "=" in line)
        self.steps = {}
        for line in self.text("steps.tsv").splitlines():
            name, result, begun, ended, why = (line.split("\t") + [""] * 5)[:5]
            self.steps[name] = (result, int(begun), int(ended), why)
        self.samples = [line.split("\t") for line in self.text("samples.tsv").splitlines()]

    def text(self, name):
        path = self.folder / name
        return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""

    def log(self, step):
        return self.text(f"log/{step}.txt")

    def profile(self, spec):
        text = self.text(f"profile/{spec}/profile.json")
        return json.loads(text) if text else None

    def profiles(self):
        return [found for name in self.steps if name.startswith("profile-") if (found := self.profile(name.removeprefix("profile-")))]

    def needs(self, step):
        """That the step was done: the words of its failure are the claim's."""
        result, _, _, why = self.steps.get(step, ("skipped", 0, 0, "the proof ended before"))
        if result == "skipped":
            raise Untried(why)
        return None if result == "done" else why

    def main_profile(self):
        """Of placement auto, or of what there is."""
        found = self.profile("auto") or next(iter(self.profiles()), None)
        if not found:
            raise Untried("nothing was profiled")
        return found

    def drawn_by(self):
        """The Vulkan device, where it is none of a headset."""
        every = "".join(self.log(step) for step in self.steps) + "".join(one["conditions"]["vulkan_device"] for one in self.profiles())
        found = re.search(r"llvmpipe|SwiftShader", every)
        return found and found.group()


def speed(found, holds, measured):
    """A claim about speed: judged by a headset's own GPU only."""
    if software := found.drawn_by():
        raise Untried(f"drawn by {software} on a computer's processor, whose speed says nothing of a headset: {measured}")
    return holds, measured


def number(quote):
    """The claim's own: the first figure of its last column."""
    return float(re.search(r"[0-9]+(?:\.[0-9]+)?", quote.rsplit("|", 1)[-1]).group())


def size(found, quote):
    if not (taken := found.device.get("apk_bytes")):
        raise Untried("the rehearsal installs no package")
    megabytes = int(taken) / 1e6
    if megabytes > 100:
        raise Untried(f"{megabytes:.0f} MB, packaged with QNN, which the figure leaves out")
    return round(megabytes) <= number(quote), f"{megabytes:.1f} MB"


def installed(found, _):
    if found.device.get("rehearsal") == "1":
        raise Untried("the rehearsal installs no package")
    why = found.needs("install")
    return why is None, why or "installed"


def rate(found, _):
    of = found.main_profile()["measured"]
    of, hz = of["pictures"], of["display_hz"]
    return speed(found, of["per_second"] >= RATE_KEPT * hz, f"{of['per_second']:.1f} of {hz:.0f} a second, {of['late']} late")


def display(found, _):
    hz = found.main_profile()["measured"]["display_hz"]
    return speed(found, round(hz) in RATES, f"{hz:.0f} Hz")


def adds_up(found, _):
    apart = 0.0
    for one in found.profiles():
        if latency := one["measured"]["latency"]:
            apart = max(apart, abs(sum(part["mean_ms"] for part in latency["parts"]) - latency["whole"]["mean_ms"]))
    if not found.profiles():
        raise Untried("nothing was profiled")
    return apart < 1e-3, f"{len(found.profiles())} profiles; the largest difference is {apart * 1e6:.0f} ns"


def latency(found, quote):
    whole = found.main_profile()["measured"]["latency"]["whole"]
    told = f"median {whole['p50_ms']:.1f} ms, 99 % within {whole['p99_ms']:.1f} ms"
    return speed(found, whole["p50_ms"] <= number(quote), told)


def heat_is_read(found, _):
    machine = found.main_profile()["machine"]
    told = [f"{len(machine['series'])} readings"] + [f"{one['what']}: {one['why']}" for one in machine["absent"]]
    return bool(machine["series"] or machine["absent"]) and all(one["why"] for one in machine["absent"]), "; ".join(told)


def provider(plan, name, takes):
    def judge(found, _):
        step = f"profile-{plan},npu={name}"
        why = found.needs(step)
        if why and "without QNN" in why:
            raise Untried("the app was packaged without QNN (./run apk --with-qnn)")
        if why and name == "nnapi" and int(found.device.get("ro.build.version.sdk") or 0) < 29:
            raise Untried(f"Android's API {found.device.get('ro.build.version.sdk')} has no such NNAPI")
        if why and "computes on the CPU alone" in why:
            raise Untried(why)
        if why:
            return False, why
        of = found.profile(f"{plan},npu={name}")
        if not of:
            return False, "the profile is not there"
        nodes = of["placement"]["landing"]["nodes"]
        told = ", ".join(f"{count} nodes on {where.removesuffix('ExecutionProvider')}" for where, count in sorted(nodes.items()))
        pictures, whole = of["measured"]["pictures"], (of["measured"]["latency"] or {}).get("whole")
        told += f"; {pictures['per_second']:.1f} pictures of {of['measured']['display_hz']:.0f} a second"
        told += f", median {whole['p50_ms']:.0f} ms, 99 % within {whole['p99_ms']:.0f} ms" if whole else ""
        own = {where.lower().removesuffix("executionprovider"): count for where, count in nodes.items()}
        holds = own.get(name) == takes if takes else set(own) == {name}
        return holds and of["placement"]["plan"] == plan, told

    return judge


def alone(found, _):
    why = found.needs("profile-gpu-alone")
    of = why is None and found.profile("gpu-alone")
    if not of:
        return False, why or "the profile is not there"
    placement, pictures = of["placement"], of["measured"]["pictures"]
    holds = placement["plan"] == "gpu-alone" and placement["provider"] is None and pictures["shown"] > 0
    return holds, f"{pictures['per_second']:.1f} pictures of {of['measured']['display_hz']:.0f} a second"


def people(count):
    def judge(found, _):
        why = found.needs(f"people-{count}")
        log = found.log(f"people-{count}")
        calls = [int(taken) for taken in re.findall(r"a call of \d+ s: (\d+) frames taken", log)]
        shown = [int(pictures) for pictures in re.findall(r"pictures of a person: (\d+) in", log)]
        holds = why is None and min(calls, default=0) > 0 and min(shown, default=0) > 0 and len(shown) == count
        return holds, why or f"frames taken of each: {', '.join(map(str, calls))}; pictures of each: {', '.join(map(str, shown))}"

    return judge


def rate_of_people(count):
    def judge(found, _):
        why = found.needs(f"people-{count}")
        rates = re.findall(r"([0-9.]+) of (\d+) a second, (\d+) late(?:; to the display ([0-9.]+) ms, 99 % within ([0-9.]+) ms)?(?:; at the end (.*))?", found.log(f"people-{count}"))
        if why or not rates:
            return False, why or "the app has measured no pictures"
        of, hz, late, half, most, quality = min(rates, key=lambda one: float(one[0]))
        told = f"{of} of {hz} a second, {late} late" + (f"; to the display {half} ms, 99 % within {most} ms" if half else "") + (f"; at the end {quality}" if quality else "")
        return speed(found, float(of) >= RATE_KEPT * float(hz), told)

    return judge


def goes_on(found, _):
    why = found.needs("pause")
    log = found.log("pause")
    back, joined = log.count("pictures are back"), log.count("joined (session")
    holds = why is None and joined == 1 and back == int(found.device["pauses"])
    return holds, why or f"{back} pauses, joined {joined} times"


def comes_back(found, _):
    why = found.needs("pause")
    times = [int(ms) for ms in re.findall(r"pictures are back (\d+) ms", found.log("pause"))]
    if why or not times:
        return False, why or "the app has not said when pictures came back"
    return speed(found, max(times) <= 1000, f"after {', '.join(map(str, times))} ms")


def payload(found, quote):
    rates = [float(rate) for step in found.steps for rate in re.findall(r"([0-9.]+) kbit/s of payload", found.log(step))]
    if not rates:
        raise Untried("no call has ended")
    return max(rates) <= number(quote), f"{max(rates):.1f} kbit/s of payload at most, {len(rates)} calls"


def loses(found, _):
    why = found.needs("loss")
    call = re.search(r"a call of (\d+) s: (\d+) frames taken, (\d+) lost", found.log("loss"))
    if why or not call:
        return False, why or "the call has not ended"
    seconds, taken, lost = map(int, call.groups())
    share, asked = lost / max(taken + lost, 1), float(found.device["loss"])
    told = f"{taken} frames taken in {seconds} s, {share * 100:.1f} % lost, of {asked * 100:.0f} % of the packets"
    # Each frame is one packet: no more of them go than packets, but for chance.
    chance = 3 * (asked * (1 - asked) / max(taken + lost, 1)) ** 0.5
    return taken > 0 and share <= asked + chance, told


def at_the_desk(found):
    """What the desk's end of the call of several has received of the headset, and why not."""
    why = found.needs("call")
    text = found.text("desk.json")
    if why or not text:
        return {}, why or "the desk has written no report"
    received = json.loads(text).get("received") or {}
    received = received[0] if isinstance(received, list) and received else received
    return (received.get("call") if isinstance(received, dict) else None) or {}, "the desk has received nothing"


def seen(found, _):
    of, why = at_the_desk(found)
    return of.get("released", 0) > 0, f"{of['released']} frames of motion at the desk" if of else why


def heard(found, _):
    of, why = at_the_desk(found)
    voice = (of.get("received") or {}).get("voice", 0)
    if of and not voice and "the microphone is open" in found.log("call"):
        raise Untried("the microphone was open, and nobody spoke")
    return voice > 0, f"{voice} packets of voice at the desk" if of else why


def cool(found, _):
    statuses = [int(one[2]) for one in found.samples if one[2:3] and one[2]]
    skins = [float(one[3]) for one in found.samples if one[3:4] and one[3]]
    if not statuses:
        raise Untried("the device's thermal service says nothing")
    minutes = int(found.samples[-1][0]) / 60
    skin = f", skin {max(skins):.1f} C at most" if skins else ""
    return max(statuses) < SEVERE, f"status {max(statuses)} of 6 at most in {minutes:.0f} minutes{skin}"


def memory(found, _):
    why = found.needs("hour")
    values = [int(one[4]) for one in found.samples if len(one) > 4 and one[4] and one[1] == "hour"]
    if why or len(values) < 16:
        return False, why or f"only {len(values)} readings"
    middle = lambda values: sorted(values)[len(values) // 2]
    # Not the first quarter: the call is got ready.
    quarter = len(values) // 4
    before, after = middle(values[quarter : 2 * quarter]), middle(values[-quarter:])
    return after - before <= GROWTH_KB + GROWTH_SHARE * before, f"{before / 1e3:.0f} MB, later {after / 1e3:.0f} MB, {len(values)} readings"


def healthy(found, _):
    # A program that Android ended by a signal says so itself, in "people" and the like.
    lines = [f"{step}: {line}" for step in found.steps for line in found.log(step).splitlines() if re.search(r" E mon3tr|panic at ", line)]
    if not any(found.log(step) for step in found.steps):
        raise Untried("there is no log")
    # A placement that a provider refuses is an error of that measurement, and a row of its own.
    lines = [line for line in lines if not line.startswith("profile-")]
    return not lines, lines[0] if lines else "no error in the log"


def said(words):
    """What the app says of itself; nothing is claimed where the headset lacks it."""

    def judge(found, _):
        log = "".join(found.log(step) for step in found.steps)
        if "the eyes' pictures" not in log:
            raise Untried("nothing was drawn")
        if not (line := re.search(rf"{words}.*", log)):
            raise Untried("the log says nothing of it")
        return True, line.group()

    return judge


def extension(words):
    def judge(found, _):
        log = "".join(found.log(step) for step in found.steps)
        if "the eyes' pictures" not in log:
            raise Untried("nothing was drawn")
        if lacks := re.search(rf"without {words}: (.*)", log):
            raise Untried(lacks.group(1))
        return True, "granted"

    return judge


DOCS = {name: f"docs/{name}.md" for name in ("android", "call", "faults", "headset", "performance", "profile")} | {"readme": "README.md", "architecture": "ARCHITECTURE.md"}
TAKES = {
    "qnn": "| QNN | all | all | all |",
    "nnapi": "| NNAPI | all, one operation a node, from Android 10 on | all | all |",
    "xnnpack": "| XNNPACK | the six matrix products; the rest is ONNX Runtime's own | the same six | five |",
    "cpu": "Providers are `npu=qnn`, `npu=nnapi`, `npu=xnnpack` and `npu=cpu`.",
}
# What is claimed, which page claims it, in which words, and who judges it.
CLAIMS = [
    ("The package's size", "readme", "signed, 44 MB", size),
    ("It installs", "readme", "adb install -r mon3tr-quest3.apk", installed),
    ("Pictures keep the display's rate, one person", "android", "auto takes what frames keep up with", rate),
    ("The display's rate is one of a Quest's", "headset", "72 Hz at first, 90 and 120 where frames keep up with room to spare", display),
    ("From capture to display, no later than on two cores without a GPU", "readme", "with sender and receiver on the same two cores, median; pictures a second | 125 ms", latency),
    ("The parts of the latency add up", "profile", "For each picture they add up to the whole, to the nanosecond. So do their means", adds_up),
    ("Temperatures and clocks are read, or it is said why not", "profile", "Values that a machine does not have, or does not let programs read, are listed with the reason.", heat_is_read),
]
for one in TAKES:
    for plan in ("npu", "cpu-tail", "cpu", "gpu"):
        six = {"npu": 6, "cpu-tail": 6, "cpu": 5, "gpu": 5}[plan] if one == "xnnpack" else None
        CLAIMS.append((f"Placement {plan} on {one}", "profile", TAKES[one], provider(plan, one, six)))
CLAIMS.append(("The GPU alone runs the networks too", "profile", "the networks too, as compute shaders", alone))
for count in range(1, 5):
    CLAIMS.append((f"People seen at once: {count}", "android", "or several of them with blanks or commas between (in the file also a list), at most 7", people(count)))
    CLAIMS.append((f"... at the display's rate: {count}", "architecture", "Where the GPU is too slow for the display, pictures lose resolution, then Gaussians", rate_of_people(count)))
CLAIMS += [
    ("In a pause the call goes on", "android", "the call goes on over the network", goes_on),
    ("After a pause pictures are back within a second", "faults", "| the app is paused (the headset is taken off) | the GPU rests, the call goes on | a picture |", comes_back),
    ("What a call takes of the network", "readme", "all headers and handshakes included (viewer to sender: 24 kbit/s) | 43 kbit/s", payload),
    ("A lost packet loses its own frame alone", "architecture", "Losing a frame affects no other frame", loses),
    ("In a call of several the wearer is seen", "android", "you are seen and heard by everyone in the call, and see and hear them", seen),
    ("... and heard", "android", "you are seen and heard by everyone in the call, and see and hear them", heard),
    ("It does not get too hot", "headset", "steady clocks, and warnings of heat in the log", cool),
    ("A call's memory does not grow", "android", "the rest was allocated before, and is in use", memory),
    ("No panic, no error in the log", "android", "A panic is logged with its place, its thread and its stack, before the process ends", healthy),
    ("Passthrough", "headset", "your own room behind the person", extension("passthrough")),
    ("What lenses hide is not drawn", "headset", "Where the runtime tells which part of an eye's picture its lens hides", said("the lenses show")),
    ("Android's scheduler takes hints of pictures", "headset", "Android's scheduler is told which threads make pictures", said("Android is told of")),
    ("Foveation", "headset", "drawing quads coarser where you do not look", extension("foveation")),
    ("Sustained clocks", "headset", "| `XR_EXT_performance_settings` | steady clocks", extension("sustained clocks")),
    ("Bare hands", "headset", "| `XR_EXT_hand_tracking` | bare hands | controllers |", extension("bare hands")),
]


def judged(found):
    """The rows: claim, where, words, verdict, what was measured."""
    for claim, page, quote, judge in CLAIMS:
        try:
            holds, measured = judge(found, quote)
            verdict = HELD if holds else BROKE
        except Untried as why:
            verdict, measured = UNTRIED, str(why)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            verdict, measured = BROKE, f"what the proof left is not understood: {error!r}"
        yield claim, DOCS[page], quote, verdict, measured


STYLE = """
:root { --ground: #fbfbfa; --ink: #1b1f24; --line: #dfe3e8; --good: #1a7f37; --bad: #b42318; --soft: #5c6672; color-scheme: light dark; }
@media (prefers-color-scheme: dark) { :root { --ground: #14171b; --ink: #e7eaee; --line: #313842; --good: #4ac26b; --bad: #ff7b72; --soft: #98a3b0; } }
body { margin: 2rem auto; max-width: 1100px; padding: 0 1rem; background: var(--ground); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
table { border-collapse: collapse; width: 100%; } td, th { border-top: 1px solid var(--line); padding: .45rem .6rem; text-align: left; vertical-align: top; overflow-wrap: anywhere; }
.held { color: var(--good); } .broke { color: var(--bad); font-weight: 600; } .untried, small { color: var(--soft); } td.verdict { white-space: nowrap; }
"""


def page(found, rows):
    say = html.escape
    counts = ", ".join(f"{sum(row[3] == verdict for row in rows)} {verdict}" for verdict in (HELD, BROKE, UNTRIED))
    model = found.device.get("ro.product.model") or "an unknown device"
    about = [f"{model}, Android {found.device.get('ro.build.version.release') or '?'}", f"commit {found.device.get('commit', '')[:12] or '?'}"]
    if found.samples:
        about.append(f"{int(found.samples[-1][0]) / 60:.0f} minutes")
    style = {HELD: "held", BROKE: "broke", UNTRIED: "untried"}
    lines = [
        f"<tr><td>{say(claim)}<br><small>{say(where)}: {say(quote)}</small></td><td>{say(measured)}</td><td class='verdict {style[verdict]}'>{verdict}</td></tr>"
        for claim, where, quote, verdict, measured in rows
    ]
    files = [
        f"<li><a href='{say(str(path.relative_to(found.folder)))}'>{say(str(path.relative_to(found.folder)))}</a></li>"
        for path in sorted(found.folder.rglob("*"))
        if path.is_file() and path.name != "proof.html"
    ]
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>What held on {say(model)}</title><style>{STYLE}</style>
<h1>What held on {say(model)}</h1>
<p>{say("; ".join(about))}. {say(counts)}. Written by <code>android/prove.sh</code>.</p>
<table><thead><tr><th>claim, and where it is made</th><th>measured</th><th>verdict</th></tr></thead><tbody>
{chr(10).join(lines)}
</tbody></table>
<h2>What it was read from</h2><ul>
{chr(10).join(files)}
</ul></html>
"""


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    texts = {where: " ".join((REPO / where).read_text(encoding="utf-8").split()) for where in DOCS.values()}
    gone = [f"{DOCS[where]} says no longer: {quote}" for _, where, quote, _ in CLAIMS if quote not in texts[DOCS[where]]]
    if gone:
        print("\n".join(gone), file=sys.stderr)
        return 2
    found = Found(Path(sys.argv[1]))
    rows = list(judged(found))
    (found.folder / "proof.html").write_text(page(found, rows), encoding="utf-8")
    for claim, _, _, verdict, measured in rows:
        print(f"{verdict:<13} {claim}: {measured}")
    print(f"\nwritten\n  {found.folder / 'proof.html'}")
    verdicts = [row[3] for row in rows]
    return 1 if BROKE in verdicts or HELD not in verdicts else 0


if __name__ == "__main__":
    sys.exit(main())

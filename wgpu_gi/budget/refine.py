"""Renders a picture within a time, to an error, or both: probes, chooses a candidate, refines, and says why it stopped.

The clock starts with the call; compiling, probes, frames and their read-back count. A frame starts only if it is
expected to end in time. The error is the noise of the frames so far (`standard_error`) plus the candidate's floor.
A picture that should have met an error is certified; if the certificate disagrees, refinement goes on, with another
candidate if more frames cannot help.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace

from ..errors import GiError
from ..options import Settings
from ..pictures.tables import Table
from ..renderer import Renderer
from .certificate import Certificate, certify
from .frame_series import FrameSeries
from .front import LEAST_FLOOR, Candidate, Choice, averages_samples, best, candidates, expected, within
from .front_cache import FrontCache
from .outcome import Outcome, missed_words, table_of
from .probe import SHOW, Probe, probe_seconds, rendered

# Most of the time that probes may take, as far as it can be told before. With a quarter, a first picture of 2 s had 1.3
# and 1.4 times the error of the best candidate in the Cornell box and the courtyard. Other shares were not compared.
PROBE_SHARE = 0.15
TRUTH_SHARE = 0.25  # of the probes' time that goes to traced pixels
TRACER_SECONDS = 0.15  # to compile the tracer of pixels; so 2 s are too short for a first probe
# An expected error may be wrong by such a factor, so a candidate is worth a probe unless even then it would lose.
OPTIMISM = 3.0
OVERSHOOT = 0.05  # share of the time by which the last frame may be late
# Another candidate replaces one that has begun if it is expected to leave at most this share of its error.
WORTH_SWITCHING = 0.6
MOST_SWITCHES = 2
CONFIDENCE = 0.9  # share of the error at which the estimate counts as below it
NOISE_LEFT = 0.1  # share of the error at which the noise cannot be why the estimate is above it: the floor is checked
READ_SECONDS, CERTIFY_SECONDS = 0.005, 1.0  # of a read-back and of a certificate, until one was measured

Report = Callable[[float, str], None]


def render_within(
    renderer: Renderer,
    seconds: float | None,
    error: float | None,
    techniques: Iterable[str] | None = None,
    progress: Report | None = None,
    stop: Callable[[], bool] | None = None,
    *,
    quality: str | None = None,
    show: tuple[str, ...] = ("radiance",),
    clock: Callable[[], float] = time.perf_counter,
) -> Outcome:
    """Render the best picture within `seconds`, or one of relMSE `error`, whichever comes first.

    techniques: None: choose among all. quality: whose presets the settings have, None: choose. The renderer's settings
    that are not at their defaults stay; those of the chosen candidate are left in it, and its buffers `show` and
    `standard_error` hold the picture. `progress` receives the fraction done and the current step. `stop` is asked
    between frames. Raises GiError without a time and an error.
    """
    if seconds is None and error is None:
        raise GiError("a budget needs a time, an error, or both")
    budget = _Budget(renderer, seconds, error, candidates(renderer.settings, techniques, quality), clock)
    if progress is not None:
        budget.report = progress
    budget.probe()
    return budget.refine((*dict.fromkeys((*show, *SHOW)),), stop or (lambda: False))


class _Budget:
    """The state of one call of `render_within`: what is left of the time, and what is known of the candidates."""

    def __init__(
        self,
        renderer: Renderer,
        seconds: float | None,
        error: float | None,
        settings: dict[Candidate, Settings],
        clock: Callable[[], float],
    ) -> None:
        self.begun, self.clock = clock(), clock
        self.renderer, self.seconds, self.error, self.settings = renderer, seconds, error, settings
        self.report: Report = lambda fraction, what: None
        self.pixels = renderer.size[0] * renderer.size[1]
        self.probe_seconds = 0.0
        self.read_seconds = READ_SECONDS
        self.certificate: Certificate | None = None
        self.refuted: set[Candidate] = set()  # a certificate found them above the error, by more than their noise
        self.certificate_seconds = CERTIFY_SECONDS
        self.had_rendered = frozenset(rendered(renderer))
        self.cache = FrontCache(renderer)
        self.known = {c: f for c, f in self.cache.load().items() if c in settings}

    @property
    def elapsed(self) -> float:
        """Seconds since the call."""
        return self.clock() - self.begun

    @property
    def left(self) -> float | None:
        """Seconds that frames may still take; None: any number."""
        return None if self.seconds is None else self.seconds - self.elapsed - self.read_seconds

    def choices(self) -> dict[Candidate, Choice]:
        """Return what each candidate is expected to reach from now on."""
        warm, left, figures = rendered(self.renderer), self.left, expected(self.settings, self.known)
        return {c: within(c, figures[c], self.pixels, left, self.error, is_warm=c in warm) for c in self.settings}

    def best(self, choices: Iterable[Choice]) -> Choice:
        """Return the best of some choices."""
        return best(choices, self.left, self.error)

    # Probing.

    def probe(self) -> None:
        """Measure candidates, the most promising first, as long as that takes a small share of the time."""
        renderer, size = self.renderer, self.renderer.size
        probe = Probe(renderer, self.clock)
        try:
            while (allowed := PROBE_SHARE * self._whole_seconds()) > self.elapsed:
                candidate = self._worth_probing(allowed - self.elapsed)
                if candidate is None:
                    break
                self.report(min(self.elapsed * PROBE_SHARE / allowed, 1.0), f"measure {candidate}")
                figures = expected(self.settings, self.known)[candidate]
                truth = TRUTH_SHARE * allowed
                self.known[candidate] = probe.measure(candidate, self.settings[candidate], figures, truth)
                self.probe_seconds = self.elapsed
        except BaseException:
            # The renderer holds a picture of another size.
            renderer.size = size
            renderer.forget()
            raise
        renderer.size = size
        if self.probe_seconds:
            self.cache.store(self.known)  # the frames may be interrupted

    def _whole_seconds(self) -> float:
        """Return the seconds of the whole: given, or expected to reach the error."""
        if self.seconds is not None:
            return self.seconds
        return self.elapsed + self.best(self.choices().values()).seconds

    def _worth_probing(self, seconds: float) -> Candidate | None:
        """Return the most promising candidate that was not measured and whose probe takes at most `seconds`.

        None if there is none that could be the best.
        """
        choices, figures, warm = self.choices(), expected(self.settings, self.known), rendered(self.renderer)
        # The first probe traces pixels, too.
        if not self.probe_seconds:
            seconds = seconds * (1.0 - TRUTH_SHARE) - TRACER_SECONDS
        others = [
            choice
            for c, choice in choices.items()
            if not figures[c].measured and probe_seconds(figures[c], self.renderer.size, is_warm=c in warm) <= seconds
        ]
        if not others or len(choices) == 1:
            return None
        promising = self.best(others)
        hopeful = promising._replace(relmse=promising.relmse / OPTIMISM)
        if self.best([*choices.values(), hopeful]) is not hopeful:
            return None
        return promising.candidate

    # Refining.

    def refine(self, show: tuple[str, ...], stop: Callable[[], bool]) -> Outcome:
        """Render frames of the best candidate until the time or the error is met."""
        switches, reason = 0, ""
        choice = self.best(self.choices().values())
        missed = self._missed(choice)
        picture = self._start(choice.candidate, show)
        while not reason:
            if stop():
                reason = "stopped by the caller"
            elif picture.frames and self.left is not None and self._is_late(picture):
                reason = "the time is over"
            elif not picture.step(self.progress_of(picture)):
                reason = "more frames would change nothing"
            elif self.error is not None and picture.is_check_due():
                reason = self._check(picture, self.error)
            is_refuted = picture.candidate in self.refuted
            if not reason and (switches < MOST_SWITCHES or is_refuted) and picture.is_review_due():
                # Go over to another candidate if this one turns out to be slower, or to err more, than expected.
                rival = self._rival(picture)
                if rival is not None:
                    picture, switches, missed = self._start(rival, show), switches + 1, None
                elif is_refuted:
                    reason = f"more frames cannot reach relMSE {self.error:g}: what is left is bias"
        self._learn(picture)
        self.cache.store(self.known)
        # What this candidate took to compile tells about the other.
        colds = {c: f.cold for c, f in expected(self.settings, self.known).items()}
        return Outcome(
            settings=picture.settings,
            candidate=picture.candidate,
            frames=picture.frames,
            seconds=self.elapsed,
            estimated_relmse=self.known[picture.candidate].relmse(picture.frames),
            certificate=self.certificate,
            reason=reason,
            probe_seconds=self.probe_seconds,
            start_seconds=picture.start_seconds,
            missed="" if missed is None else missed_words(missed, colds[missed.candidate]),
            table=self._table(picture.candidate),
        )

    def _missed(self, chosen: Choice) -> Choice | None:
        """Return the choice that would be best if its pipelines existed; None if it is hardly better, or has them."""
        figures, warm = expected(self.settings, self.known), rendered(self.renderer)
        ready = (within(c, f, self.pixels, self.left, None, is_warm=True) for c, f in figures.items())
        better = min(ready, key=lambda choice: choice.relmse)
        # Nothing is missed by a picture that reaches the error.
        enough = max(WORTH_SWITCHING * chosen.relmse, self.error or 0.0)
        if self.seconds is None or better.candidate in {*warm, chosen.candidate} or better.relmse > enough:
            return None
        return better

    def _table(self, chosen: Candidate) -> Table:
        """Return what each candidate was expected to reach in the whole time, with its pipelines."""
        figures = expected(self.settings, self.known)
        reached = [within(c, f, self.pixels, self.seconds, self.error, is_warm=True) for c, f in figures.items()]
        return table_of(figures, reached, chosen, self.had_rendered, self.pixels)

    def _start(self, candidate: Candidate, show: tuple[str, ...]) -> FrameSeries:
        figures = expected(self.settings, self.known)[candidate]
        return FrameSeries(self.renderer, self.clock, candidate, self.settings[candidate], figures, self.seconds, show)

    def _learn(self, picture: FrameSeries) -> None:
        """Take the figures of a picture's frames so far."""
        before, c = self.clock(), picture.candidate
        self.known[c] = picture.learn(expected(self.settings, self.known)[c])
        self.read_seconds = self.clock() - before

    def progress_of(self, picture: FrameSeries) -> Callable[[float], None]:
        """Return a function that reports the progress of a picture."""

        def report(_: float) -> None:
            if self.seconds is not None:
                share = self.elapsed / self.seconds
            else:
                share = picture.frames / (picture.frames + self.choices()[picture.candidate].frames)
            self.report(min(share, 1.0), picture.words)

        return report

    def _is_late(self, picture: FrameSeries) -> bool:
        """Return whether another frame would end too late."""
        assert self.seconds is not None and self.left is not None
        step = picture.step_seconds
        return step > self.left + min(OVERSHOOT * self.seconds, step / 2)

    def _rival(self, picture: FrameSeries) -> Candidate | None:
        """Return a candidate that is worth starting over for; None if there is none."""
        self._learn(picture)
        choices, figures = self.choices(), self.known[picture.candidate]
        own = choices.pop(picture.candidate)
        if not choices:
            return None
        # What was not measured must be expected to win by the factor by which it may be wrong, if there is a choice.
        known = {c for c, f in self.known.items() if f.measured}
        doubt = 1.0 if picture.candidate in self.refuted else OPTIMISM
        other = self.best(o if c in known else o._replace(relmse=o.relmse * doubt) for c, o in choices.items())
        if self.error is not None and other.relmse <= self.error:
            # What the current candidate still needs, infinitely much if it cannot reach the error.
            needed = own.seconds - picture.frames * figures.frame_seconds(self.pixels)
            better = other.seconds < WORTH_SWITCHING * needed
        else:
            better = other.relmse < WORTH_SWITCHING * figures.relmse(own.frames + picture.frames)
        # Another one must be in time.
        better &= self.left is None or other.seconds <= self.left
        return other.candidate if better else None

    def _check(self, picture: FrameSeries, error: float) -> str:
        """Return why the picture is done if its error is met, as a certificate confirms; else an empty text."""
        self._learn(picture)
        figures = self.known[picture.candidate]
        noise = figures.noise / picture.frames
        if figures.floor + noise > CONFIDENCE * error and noise > NOISE_LEFT * error:
            return ""
        if self.left is not None and self.left < self.certificate_seconds:
            return ""
        # The certificate decides; if it disagrees, it tells the floor.
        before = self.clock()
        try:
            self.certificate = certify(self.renderer)
        except GiError as problem:
            return f"no certificate: {problem}"
        self.certificate_seconds = self.clock() - before
        found = self.certificate.relmse.value
        if found <= error:
            return f"relMSE {error:g} is reached"
        if averages_samples(picture.candidate):
            return ""  # it has no floor: its noise is larger than estimated
        self.known[picture.candidate] = replace(figures, floor=max(found - noise, LEAST_FLOOR), measured=True)
        if found - noise >= error and noise <= NOISE_LEFT * error:
            self.refuted.add(picture.candidate)
        picture.review()
        return ""

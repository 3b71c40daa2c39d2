"""Renders a picture within a time, to an error, or both: chooses a candidate, refines, and says why it stopped.

The clock starts with the call; compiling, frames and their read-back count. A frame starts only if it is expected to
end in time. The first candidate is chosen by typical figures, or by those of the view's last picture. After the first
frames, and again after twice as many, a review compares it with the others by what the frames told; a small share of
the time goes to traced pixels if another candidate may be better, which only its bias can tell. The error is the noise
of the frames so far (`standard_error`) plus the candidate's floor. A picture that should have met an error is
certified; if the certificate disagrees, refinement goes on, with another candidate if more frames cannot help.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import replace

from ..errors import GiError
from ..options import Settings
from ..renderer import Renderer
from .certificate import Certificate, certify
from .choice import Choice, best, rival, within
from .frame_series import SHOW, FrameSeries, rendered
from .front import LEAST_FLOOR, Candidate, Figures, averages_samples, candidates
from .front_cache import AdapterCache, FrontCache
from .outcome import Outcome, missed_words, table_of, time_words
from .traced import TracedPixels
from .typical import TYPICAL, expected

OVERSHOOT = 0.05  # share of the time by which the last frame may be late
# Traced pixels take such a share of the time, or of the time so far if only an error was given, if they take at least
# the seconds to compile. They wait until so many times that share has passed: too few frames tell nothing.
TRACE_SHARE, TRACE_SHARE_OF_PAST, TRACE_AFTER = 0.05, 0.25, 1.0
TRACER_SECONDS = 0.15
# Another candidate is worth traced pixels if it may be better: by this many standard deviations.
HOPE = 1.5
MISSED = 0.7  # share of the error that another would leave, for it to be worth a word
MOST_SWITCHES = 2
CONFIDENCE = 0.9  # share of the error at which the estimate counts as below it
NOISE_LEFT = 0.1  # share of the error at which the noise cannot be why the estimate is above it: the floor is checked
CERTIFIED_SPREAD = 0.3  # of the logarithm of a floor, by a certificate
UNKNOWN = TYPICAL[Candidate("path", "medium")]
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
    begun = clock()
    settings = candidates(renderer.settings, TYPICAL, techniques, quality)
    budget = _Budget(renderer, seconds, error, settings, clock, begun)
    if progress is not None:
        budget.report = progress
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
        begun: float,
    ) -> None:
        self.begun, self.clock = begun, clock
        self.renderer, self.seconds, self.error, self.settings = renderer, seconds, error, settings
        self.report: Report = lambda fraction, what: None
        self.pixels = renderer.size[0] * renderer.size[1]
        self.started: set[Candidate] = set()
        self.traced: TracedPixels | None = None
        self.read_seconds = READ_SECONDS
        self.certificate: Certificate | None = None
        self.refuted: set[Candidate] = set()  # a certificate found them above the error, by more than their noise
        self.certificate_seconds = CERTIFY_SECONDS
        self.had_rendered = frozenset(rendered(renderer))
        self.cache, self.adapter = FrontCache(renderer), AdapterCache(renderer)
        self.used = self.adapter.load()
        self.known = {c: f for c, f in self.cache.load().items() if c in settings}

    @property
    def elapsed(self) -> float:
        """Seconds since the call."""
        return self.clock() - self.begun

    @property
    def left(self) -> float | None:
        """Seconds that frames may still take; None: any number."""
        return None if self.seconds is None else self.seconds - self.elapsed - self.read_seconds

    def figures(self) -> dict[Candidate, Figures]:
        """Return the figures of each candidate, as far as they are known."""
        return expected(self.settings, self.known, self.used)

    def choices(self, picture: FrameSeries | None = None) -> dict[Candidate, Choice]:
        """Return what each candidate is expected to reach from now on; that of `picture` goes on."""
        warm, left, pixels, found = rendered(self.renderer), self.left, self.pixels, {}
        for c, figures in self.figures().items():
            done = picture.frames if picture is not None and picture.candidate == c else 0
            found[c] = within(c, figures, pixels, left, self.error, is_warm=c in warm, done=done)
            if c in self.refuted:
                found[c] = found[c]._replace(chance=0.0, seconds=math.inf)
        return found

    def refine(self, show: tuple[str, ...], stop: Callable[[], bool]) -> Outcome:
        """Render frames of the best candidate until the time or the error is met."""
        switches, reason = 0, ""
        choice = best(self.choices().values(), self.left)
        missed = self._missed(choice)
        picture = self._start(choice.candidate, show)
        while not reason:
            if stop():
                reason = "stopped by the caller" + self._remaining(picture)
            elif picture.frames and self.left is not None and self._is_late(picture):
                reason = "the time is over"
            elif not picture.step(self.progress_of(picture)):
                reason = "more frames would change nothing"
            elif self.error is not None and picture.is_check_due():
                reason = self._check(picture, self.error)
            is_refuted = picture.candidate in self.refuted
            if not reason and picture.is_review_due():
                # Go over to another candidate if this one turns out to be slower, or to err more, than expected.
                rival = self._review(picture) if switches < MOST_SWITCHES or is_refuted else None
                if rival is not None:
                    picture, switches, missed = self._start(rival, show), switches + 1, None
                elif is_refuted:
                    reason = f"more frames cannot reach relMSE {self.error:g}: what is left is bias"
        self._learn(picture)
        self.cache.store(self.known)
        self.adapter.store(self.known, self.started, self.had_rendered)
        return self._outcome(picture, reason, missed)

    def _outcome(self, picture: FrameSeries, reason: str, missed: Choice | None) -> Outcome:
        figures = self.figures()
        reached = [within(c, f, self.pixels, self.seconds, self.error, is_warm=True) for c, f in figures.items()]
        return Outcome(
            settings=picture.settings,
            candidate=picture.candidate,
            frames=picture.frames,
            seconds=self.elapsed,
            estimated_relmse=self.known[picture.candidate].relmse(picture.frames),
            certificate=self.certificate,
            reason=reason,
            traced_seconds=0.0 if self.traced is None else self.traced.seconds,
            start_seconds=picture.start_seconds,
            # What this candidate took to compile tells about the other.
            missed="" if missed is None else missed_words(missed, figures[missed.candidate].cold),
            # What each was expected to reach in the whole time, with its pipelines.
            table=table_of(figures, reached, picture.candidate, self.had_rendered, self.pixels),
        )

    def _missed(self, chosen: Choice) -> Choice | None:
        """Return the choice that would be best if its pipelines existed; None if it is hardly better, or has them."""
        warm = rendered(self.renderer)
        ready = (within(c, f, self.pixels, self.left, None, is_warm=True) for c, f in self.figures().items())
        better = min(ready, key=lambda choice: choice.score)
        # Nothing is missed by a picture that reaches the error.
        enough = max(MISSED * chosen.relmse, self.error or 0.0)
        if self.seconds is None or better.candidate in {*warm, chosen.candidate} or better.relmse > enough:
            return None
        return better

    def _start(self, candidate: Candidate, show: tuple[str, ...]) -> FrameSeries:
        figures, settings = self.figures()[candidate], self.settings[candidate]
        self.started.add(candidate)
        return FrameSeries(
            self.renderer,
            self.clock,
            candidate,
            settings,
            figures,
            self.seconds,
            show,
            has_rivals=any(c.gi == candidate.gi for c in self.settings if c != candidate),
        )

    def _learn(self, picture: FrameSeries) -> None:
        """Take the figures of a picture's frames so far."""
        before = self.clock()
        self.known[picture.candidate] = picture.learn(self.traced)
        self.read_seconds = self.clock() - before

    def progress_of(self, picture: FrameSeries) -> Callable[[float], None]:
        """Return a function that reports the progress of a picture."""

        def report(_: float) -> None:
            if self.seconds is not None:
                self.report(min(self.elapsed / self.seconds, 1.0), picture.words)
                return
            total = self.choices(picture)[picture.candidate].frames
            self.report(min(picture.frames / max(total, 1), 1.0), picture.words + self._remaining(picture))

        return report

    def _remaining(self, picture: FrameSeries) -> str:
        """Return words on how long the error still takes; none without an error, or without a frame."""
        if self.error is None or not picture.frames:
            return ""
        return f", {time_words(self.choices(picture)[picture.candidate], self.error)}"

    def _is_late(self, picture: FrameSeries) -> bool:
        """Return whether another frame would end too late."""
        assert self.seconds is not None and self.left is not None
        step = picture.step_seconds
        return step > self.left + min(OVERSHOOT * self.seconds, step / 2)

    # Reviews.

    def _review(self, picture: FrameSeries) -> Candidate | None:
        """Return a candidate that is worth starting over for; None if there is none. Trace pixels if they may tell."""
        self._learn(picture)
        seconds = self._trace_seconds(picture)
        if seconds and self._may_win(picture):
            self.report(min(self.elapsed / (self.seconds or math.inf), 1.0), "measure the bias")
            self.traced = TracedPixels(self.renderer, self.clock, seconds)
            self._learn_path(picture)
            self._learn(picture)
        rival = self._rival(picture)
        if rival is None or not averages_samples(rival) or self.known.get(rival, UNKNOWN).measured:
            return rival
        # The path tracer has no floor, so it looks best where the other's is not known: in the Cornell box, 10 s of it
        # had twice the error of many-light. If only an error was given, it is what surely meets it.
        return rival if self.seconds is None or picture.candidate in self.refuted else None

    def _trace_seconds(self, picture: FrameSeries) -> float:
        """Return the seconds that traced pixels may take; 0 if they must not, or exist."""
        if self.traced is not None or len(self.settings) == 1 or picture.frames < 2:
            return 0.0
        if self.seconds is None:
            allowed = TRACE_SHARE_OF_PAST * self.elapsed
        else:
            allowed = TRACE_SHARE * self.seconds
            if self.elapsed < TRACE_AFTER * allowed:
                return 0.0
        return allowed if allowed > TRACER_SECONDS else 0.0

    def _may_win(self, picture: FrameSeries) -> bool:
        """Return whether another candidate may be better than this one by more than its bias is known."""
        choices = self.choices(picture)
        own = choices.pop(picture.candidate)
        if self.error is not None and LEAST_FLOOR < 1.0 - own.chance < 1.0 - LEAST_FLOOR:
            return True
        return any(
            math.log(other.relmse) - HOPE * math.hypot(other.doubt, own.doubt) < math.log(own.relmse)
            for c, other in choices.items()
            if averages_samples(c) or averages_samples(own.candidate)
        )

    def _learn_path(self, picture: FrameSeries) -> None:
        """Take what traced pixels tell about the path tracer."""
        assert self.traced is not None
        noise = self.traced.path_noise(*picture.read())
        for c, figures in self.figures().items():
            if averages_samples(c) and c != picture.candidate:
                self.known[c] = replace(figures, noise=noise.median, noise_spread=noise.spread, measured=True)

    def _rival(self, picture: FrameSeries) -> Candidate | None:
        """Return a candidate that is worth starting over for; None if there is none."""
        figures = self.known[picture.candidate]
        return rival(self.choices(picture), picture.candidate, self.left, self.refuted, figures.shared)

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
        picture.correct(max(found - noise, LEAST_FLOOR), CERTIFIED_SPREAD)
        if found - noise >= error and noise <= NOISE_LEFT * error:
            self.refuted.add(picture.candidate)
        return ""

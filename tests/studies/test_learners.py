"""The study of the speed of learners."""

from studies.speed import learners


def test_time_of_a_stroke_leaves_out_what_does_not_grow(monkeypatch):
    """Of a training that takes 5 s and 2 ms a stroke."""
    clock = [0.0]
    monkeypatch.setattr(learners.time, "process_time", lambda: clock[0])

    def run(strokes):
        clock[0] += 5.0 + 0.002 * strokes

    assert abs(learners.processor_seconds(run, 3) - 0.002) < 1e-9


def test_the_ratio_is_of_rounds_in_turn(monkeypatch):
    trained = []
    monkeypatch.setattr(learners, "stable_baselines3", trained.append)
    monkeypatch.setattr(learners, "single_file", lambda: trained.append)
    seconds = iter([1e-3, 2e-3, 1e-3, 4e-3, 1e-3, 3e-3])
    monkeypatch.setattr(learners, "processor_seconds", lambda run, updates: next(seconds))
    found = learners.measure(rounds=3, updates=1)
    assert trained == [learners.ROLLOUT] * 2
    assert found["ratio"] == 3.0 and found["range of the ratio"] == [2.0, 4.0]
    assert found["loop in one file [strokes per second]"] == 1000

"""What follows from the numbers of this room, whose studies have command lines of their own."""

from studies.accuracy import page, promises, ringing, work_precision_page
from studies.frame import Study

STUDIES = (
    Study(
        "accuracy",
        tables={
            name: lambda _, name=name: getattr(page, name)()  # type: ignore[misc]
            for name in ("errors", "choosing", "presets", "timed", "timed_paths")
        },
        drawn=("convergence.png", "work_precision.png"),
    ),
    Study("accuracy.error_bars", file="error_bars.json", drawn=("error_bars.png",)),
    Study("accuracy.promises", file="promises.json", tables={"promises": promises.table}),
    Study("accuracy.ringing", file="ringing.json", pictures={"ringing.png": ringing.draw},
          tables={"ringing": ringing.table}),
    Study(
        "accuracy.work_precision",
        file="work_precision.json",
        pictures={"work_precision_problems.png": work_precision_page.draw},
        pages={"work_precision.md": lambda found: work_precision_page.as_page(found, "work_precision_problems.png")},
    ),
)  # fmt: skip

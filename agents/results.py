"""Results of an evaluation as a table for print."""

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from seastar_gym.evaluation.results import COLUMNS, in_words, number
from seastar_gym.evaluation.swim import Swim


def results_table(swims: Sequence[Swim]) -> Table:
    """Table for print."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, pad_edge=False)
    unit = {done.counted_in for done in swims}
    for name, title in COLUMNS.items():
        title = title if unit == {"strokes"} else title.replace("strokes", "decisions")
        if name == "agent":
            table.add_column(title, vertical="bottom", overflow="fold")
        else:
            table.add_column(Text(title), justify="right", no_wrap=True)
    for row in in_words(swims):
        table.add_row(*(Text(number(row[name])) for name in COLUMNS))
    return table

"""Option of the command lines that names agents."""

from typing import Annotated, TypeAlias

import tyro

from seastar_gym.controllers.roster import HELP

AgentNames: TypeAlias = Annotated[tuple[str, ...], tyro.conf.arg(help=HELP)]

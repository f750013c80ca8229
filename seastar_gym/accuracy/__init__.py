"""What speed costs a scene in accuracy.

In comes a scene; out goes a `Certificate`, its settings with their measured errors and speeds, of which `scene_for`
takes the fastest below an error. `certify(scene)` and `seastar certify` measure one (measure.py, command.py) over
classes of commands (commands.py); those of the chapter's robot come with the package (chapters.py). Errors are those of
swims beside finer ones: no formula foretells them. resonance.py finds the modes that decisions may drive.
"""

from seastar_gym.accuracy.certificate import Certificate, Setting, as_certificate
from seastar_gym.accuracy.chapters import chapters_certificate, scene_for, timed_certificate

__all__ = ["Certificate", "Setting", "as_certificate", "chapters_certificate", "scene_for", "timed_certificate"]

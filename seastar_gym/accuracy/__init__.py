"""What speed costs a scene in accuracy: settings with their measured errors, and the certificates that hold them.

`certify(scene)` and `seastar certify` measure them of any scene (measure.py, command.py); those of the
chapter's robot come with the package (chapter.py).
"""

from seastar_gym.accuracy.certificate import Certificate, Setting, as_certificate
from seastar_gym.accuracy.chapters import chapters_certificate, scene_for, timed_certificate

__all__ = ["Certificate", "Setting", "as_certificate", "chapters_certificate", "scene_for", "timed_certificate"]

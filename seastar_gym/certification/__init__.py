"""Measures the errors of any scene: `certify(scene)` and `python -m seastar_gym.certify`."""

from seastar_gym.certification.measure import certify
from seastar_gym.scene.certificate import Certificate, CertifiedSetting

__all__ = ["Certificate", "CertifiedSetting", "certify"]

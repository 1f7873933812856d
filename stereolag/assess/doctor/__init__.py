"""The input doctor: problems of a stereo pair, measured before it is matched, and their remedies."""

from stereolag.assess.doctor.diagnosis import Diagnosis, diagnose, estimate_diagnosis, judge_range
from stereolag.assess.doctor.findings import Finding, FindingCode, Remedy
from stereolag.assess.doctor.remedies import apply_remedy

__all__ = [
    "Diagnosis",
    "Finding",
    "FindingCode",
    "Remedy",
    "apply_remedy",
    "diagnose",
    "estimate_diagnosis",
    "judge_range",
]

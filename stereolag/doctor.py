"""The input doctor, under the name by which scripts import it."""

from stereolag.assess.diagnosis import Diagnosis, apply_remedy, diagnose, judge_range
from stereolag.assess.findings import Finding, FindingCode, Remedy

__all__ = ["Diagnosis", "Finding", "FindingCode", "Remedy", "apply_remedy", "diagnose", "judge_range"]

"""The input doctor by the name under which scripts import it."""

from stereolag.assess.diagnosis import (
    Diagnosis,
    Finding,
    FindingCode,
    Remedy,
    apply_remedy,
    diagnose,
    judge_range,
)

__all__ = ["Diagnosis", "Finding", "FindingCode", "Remedy", "apply_remedy", "diagnose", "judge_range"]

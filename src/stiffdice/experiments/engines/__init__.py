"""The same contact, throw and limits in every engine."""

// throw

def save(records): pass

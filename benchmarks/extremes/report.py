def save(rows): pass

// die

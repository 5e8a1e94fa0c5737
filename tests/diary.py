"""An object for another process, which keeps what it is told and calls back."""

import logging
import os
import time


class Diary:
    def __init__(self, owner, *, on_word=None, on_close=None, stubborn=False):
        if not owner:
            raise ValueError("owner must have a name; got none")
        self.entries, self.stubborn = [owner], stubborn
        self.on_word, self.on_close = on_word, on_close
        print("what is printed is no message")

    @property
    def process(self):
        return os.getpid(), os.nice(0), os.sched_getscheduler(0)

    def write(self, word, *, slowly=0.0):
        self.entries.append(word)
        self.on_word(word)
        time.sleep(slowly)

    def warn(self, sentence):
        logging.getLogger("smoskin.diary").warning("%s said so", sentence)

    def fail(self):
        raise KeyError("no such page")

    def vanish(self):
        os._exit(3)

    def close(self):
        while self.stubborn:
            time.sleep(1.0)
        self.on_close(self.entries)

#!/usr/bin/env python3
"""Tests of settled.py, without a browser."""

import pathlib
import sys
import unittest
import unittest.mock

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
import settled  # noqa: E402


def figures(frame, rate=14, p95_ms=80, skipped=0):
    return {"frame": frame, "rate": rate, "p95_ms": p95_ms, "skipped": skipped}


class SettledTest(unittest.TestCase):
    def settles_at(self, samples):
        """Index of the first sample with which the session has settled."""
        decision = settled.Settled(14, 100)
        return next((index for index, sample in enumerate(samples) if decision.add(sample)), None)

    def test_a_session_at_its_rate_settles_after_so_many_frames(self):
        self.assertEqual(self.settles_at([figures(7 * n) for n in range(40)]), 15)

    def test_a_slow_second_begins_again(self):
        samples = [figures(7 * n, rate=4 if n == 10 else 13) for n in range(40)]
        self.assertEqual(self.settles_at(samples), 26)

    def test_the_station_of_the_old_picture_never_settles(self):
        self.assertIsNone(self.settles_at([figures(7 * n, rate=4, p95_ms=234, skipped=94) for n in range(100)]))

    def test_skipped_frames_begin_again(self):
        self.assertIsNone(self.settles_at([figures(7 * n, skipped=n) for n in range(100)]))
        self.assertEqual(self.settles_at([figures(7 * n, skipped=94) for n in range(40)]), 15)

    def test_latencies_must_be_steady(self):
        self.assertIsNone(self.settles_at([figures(7 * n, p95_ms=234) for n in range(100)]))
        self.assertIsNone(self.settles_at([figures(7 * n, p95_ms=None) for n in range(100)]))

    def test_a_page_without_figures_has_not_settled(self):
        self.assertIsNone(self.settles_at([figures(0, rate=None)] * 10))

    def test_a_page_that_was_loaded_again_begins_again(self):
        samples = [figures(1000 + 7 * n) for n in range(5)] + [figures(7 * n) for n in range(40)]
        self.assertEqual(self.settles_at(samples), 5 + 1 + 15)

    def test_the_error_says_what_the_page_shows(self):
        class Page:
            def script(self, _):
                return figures(3, rate=4, p95_ms=234, skipped=94)

            def wait(self, what, condition, seconds):
                assert not condition()
                raise AssertionError(f"waited {seconds} s in vain for: {what}")

        with self.assertRaisesRegex(AssertionError, "4 of 14 frames/s, p95 234 ms, 94 skipped"):
            settled.wait(Page(), 14)

    def test_waiting_ends_when_the_session_has_settled(self):
        class Page:
            frame = 0

            def script(self, _):
                self.frame += 7
                return figures(self.frame)

            def wait(self, what, condition, seconds):
                assert any(condition() for _ in range(seconds)), what

        with unittest.mock.patch("settled.time.sleep"):
            settled.wait(Page(), 14)


if __name__ == "__main__":
    unittest.main()

# Everything a newcomer types. Each target brings the machine to where it works by scripts/setup.
CARGO ?= cargo
# rustup puts cargo here; a shell that was open before doesn't know.
export PATH := $(HOME)/.cargo/bin:$(PATH)
# Extra arguments, as in: make demo ARGS="--out DIR"
ARGS ?=

.PHONY: help demo live window test test-browser test-window test-training train bench soak hard wheel test-python setup clean

help:
	@echo 'make demo   the whole chain live on a recorded exam, in the browser, then its frames, contact sheet, video, times'
	@echo 'make live   the same exam as a live station, again and again until Ctrl-C'
	@echo 'make test   format, lints, all tests and documentation; what cannot run here is listed as ignored'
	@echo 'make test-browser  the live page in a headless Chromium; ARGS="--screenshot FILE" keeps a picture of it'
	@echo 'make window  the program with its native window, target/release/insonify: insonify run STATION --sink window'
	@echo 'make test-window  that window on a virtual screen (Xvfb, xdotool)'
	@echo 'make bench  measure set-up, changes, poses, and time against scene and settings; frames: insonify bench STATION'
	@echo 'make soak   ten minutes of a live station on a bad day: memory, latency and drops; scripts/soak --help'
	@echo 'make hard   a million random frames worth of rays without a value that is not finite; goes on where it was stopped'
	@echo 'make train  train every generator of the tables from nothing; says how long; goes on where it was stopped'
	@echo 'make test-training  the tests of the training package (training/)'
	@echo 'make wheel  the Python package with the program inside, target/wheels/insonify-*.whl; scripts/wheel --help'
	@echo 'make test-python  installs that wheel into a bare environment and runs its tests; ARGS=--all for torch and ray, too'
	@echo 'make setup  what the others do first; scripts/setup --help says more'
	@echo 'make clean  remove what was built and rendered'

demo: setup
	$(CARGO) run --release -- demo $(ARGS)

live: setup
	$(CARGO) run --release -- run configs/live.toml $(ARGS)

test:
	@scripts/setup --test
	CARGO='$(CARGO)' scripts/test

test-browser:
	@scripts/setup --test
	$(CARGO) build --release --example browser_demo
	python3 tests/browser/end_to_end.py target/release/examples/browser_demo $(ARGS)

window: setup
	$(CARGO) build --release --features window

test-window:
	@scripts/setup --test
	$(CARGO) build --release --example browser_demo --features window
	$(CARGO) test --release --features window --lib sink::window
	python3 tests/browser/window.py target/release/examples/browser_demo $(ARGS)

bench: setup
	$(CARGO) bench $(ARGS)

soak: setup
	$(CARGO) build --release --bin insonify
	python3 scripts/soak $(ARGS)

train: setup
	scripts/train $(ARGS)

test-training:
	scripts/train --test $(ARGS)

hard: setup
	$(CARGO) run --release --example hard -- $(ARGS)

wheel: setup
	scripts/wheel $(ARGS)

test-python:
	scripts/test-python $(ARGS)

setup:
	@scripts/setup

clean:
	$(CARGO) clean
	rm -rf out

# What people type here. Cargo does the work; the longer scripts are in tools/.

CARGO ?= cargo
BUILT := $(or $(CARGO_TARGET_DIR),target)

.DEFAULT_GOAL := help
.PHONY: help run test check dist fuzz sim day breaks bench microbench fmt docs clean

help: ## Show this list
	@echo "Targets (ARGS=\"...\" is passed on to run, dist, day, breaks and bench):"
	@sed -n 's/^\([a-z]*\):[^#]*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 14

run: ## Build the dashboard and r6 for release, and start a virtual cell: r6 up ARGS (without ARGS: --demo)
	@tools/test toolchain run
	@tools/web build || echo "going on without the dashboard"
	@$(CARGO) build --release --locked --package r6
	@exec "$(BUILT)/release/r6" up $(or $(ARGS),--demo)

test: ## Run all tests: Rust, the examples in the documentation, the dashboard, Python
	@tools/test

check: ## Check everything else: format, lints, docs, dependencies, each crate alone, oracles, Python types
	@tools/test check

dist: ## Build into target/dist what would be published (crates, wheel, Debian package, checksums), and try it; ARGS="deb try-deb" chooses stages
	@tools/dist/run $(ARGS)

sim: ## Break clients, controllers, cameras, gateways and disks in one process: SEEDS=1000 [FROM=1] [JOBS=cores] [MARKDOWN=1] [TRAP=all: only worlds with one trap] [GATEWAY=1: only worlds with a gateway] [DRIVERS=all: dropped and slow calls drive], or all of one: SEED=7 [TRAP=E1] [GATEWAY=1] [DRIVERS=all] (dev profile)
	@$(CARGO) build --locked --package r6-world
	@"$(BUILT)/debug/r6-world" $(if $(SEED),--seed $(SEED),--seeds $(or $(SEEDS),1000)) $(if $(FROM),--from $(FROM)) $(if $(JOBS),--jobs $(JOBS)) $(if $(MARKDOWN),--markdown) $(if $(TRAP),--trap $(TRAP)) $(if $(DRIVERS),--drivers $(DRIVERS)) $(if $(GATEWAY),--gateway)

day: ## Run a gateway with 200 robots for 24 simulated hours, and look at memory, tasks and files; up to an hour and a half (docs/SIMULATION.md)
	@$(CARGO) build --release --locked --package r6-world --bin day
	@"$(BUILT)/release/day" $(ARGS)

breaks: ## Break each promise on purpose, in a copy, and show that a plan of make sim or a test sees it: ARGS="Gapless A1" chooses rows of crates/r6-world/breaks.toml; half an hour for all (docs/SIMULATION.md)
	@tools/test toolchain
	@tools/breaks $(ARGS)

bench: ## Measure r6 beside others, as ratios; ARGS="round-trip codec" chooses rows, without it docs/BENCHMARKS.md is written (wants redis-server and tools/python/run bench)
	@$(CARGO) build --profile bench --locked --package r6-bench
	@"$(BUILT)/release/r6-bench" $(ARGS)

fuzz: ## Look for inputs that break a promise: SECONDS=60 for each, TARGET=name, JOBS=1 at the same time, RECORD=1 into docs/RELIABILITY.md
	@tools/fuzz --seconds "$(or $(SECONDS),60)" --target "$(TARGET)" --jobs "$(or $(JOBS),1)" $(if $(RECORD),--record)

microbench: ## Run the benchmarks of single functions; ARGS go to criterion, such as a part of a name
	@$(CARGO) bench --locked --workspace --bench '*' -- $(ARGS)

fmt: ## Format the Rust sources
	@$(CARGO) fmt --all

docs: ## Build the API documentation of the workspace, and the book of docs/
	@RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --workspace --no-deps
	@tools/book
	@echo "Open target/book/docs/index.html and $(BUILT)/doc/r6_client/index.html"

clean: ## Remove what was built, the tools in target/tools included
	@$(CARGO) clean
	@rm -rf target/tools target/web-built-from crates/r6-gateway/page/built web/node_modules

# What people type here. Cargo does the work; the longer scripts are in tools/.

CARGO ?= cargo
BUILT := $(or $(CARGO_TARGET_DIR),target)

.DEFAULT_GOAL := help
.PHONY: help run test sim bench microbench fmt docs clean

help: ## Show this list
	@echo "Targets (ARGS=\"...\" is passed on to run and bench):"
	@sed -n 's/^\([a-z]*\):[^#]*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 14

run: ## Build r6 for release and start virtual controllers: r6 up ARGS
	@tools/test toolchain
	@$(CARGO) build --release --locked --package r6
	@exec "$(BUILT)/release/r6" up $(ARGS)

test: ## Run every check: format, lints, docs, dependencies, tests
	@tools/test

sim: ## Break clients, controllers, cameras and disks in one process: SEEDS=1000 [FROM=1] [JOBS=2], or all of one: SEED=7
	@$(CARGO) build --locked --package r6-world
	@"$(BUILT)/debug/r6-world" $(if $(SEED),--seed $(SEED),--seeds $(or $(SEEDS),1000)) $(if $(FROM),--from $(FROM)) $(if $(JOBS),--jobs $(JOBS))

bench: ## Measure r6 beside others, as ratios; ARGS="round-trip codec" chooses rows, without it docs/BENCHMARKS.md is written
	@$(CARGO) build --profile bench --locked --package r6-bench
	@"$(BUILT)/release/r6-bench" $(ARGS)

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
	@rm -rf target/tools

//! The built binary as users run it: its help, the commands that need no robot, and all others against `r6
//! sim`.

mod by_gateway;
mod crowded;
mod ends;
mod forged;
mod gateway;
mod gateway_kills;
mod hall;
mod help;
mod inspect;
mod limits;
mod motion;
mod offline;
mod panel;
mod plot;
mod power_cut;
mod problems;
mod robot;
mod run;
mod several_gateways;
mod sim;
mod stopping;
mod streaming;
mod support;
mod twins;
mod unwritten;

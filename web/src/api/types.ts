/** The types of the API that the page uses, by their short names. They come from openapi/gateway.json. */
import type { components } from "./schema.d.ts";

type Schemas = components["schemas"];

export type Code = Schemas["Code"];
export type Problem = Schemas["Problem"];
export type Session = Schemas["Session"];
export type Role = Schemas["Role"];
export type RobotSummary = Schemas["RobotSummary"];
export type RobotState = Schemas["RobotState"];
export type RobotAlarm = Schemas["RobotAlarm"];
export type RobotAlarms = Schemas["RobotAlarms"];
export type Signal = Schemas["Signal"];
export type SignalQuality = Schemas["SignalQuality"];
export type AddressValue = Schemas["AddressValue"];
export type Lease = Schemas["Lease"];
export type LeaseKey = Schemas["LeaseKey"];
export type LiveSent = Schemas["LiveSent"];
export type GatewayEvent = Schemas["Event"];
export type CommandRequest = Schemas["CommandRequest"];
export type CommandDone = Schemas["CommandDone"];
export type Stopped = Schemas["Stopped"];
export type Settings = Schemas["Settings"];
export type Queried = Schemas["Queried"];
export type Audit = Schemas["Audit"];
export type AuditEntry = Schemas["AuditEntry"];
export type AuditHead = Schemas["AuditHead"];
export type HallSettings = Schemas["HallSettings"];
export type RobotIdentity = Schemas["RobotIdentity"];
export type RobotWanted = Schemas["RobotWanted"];
export type Ready = Schemas["Ready"];
export type Weekday = Schemas["Weekday"];
export type Token = Schemas["Token"];
export type TokenMade = Schemas["TokenMade"];
export type TokenWanted = Schemas["TokenWanted"];
export type User = Schemas["User"];
export type UserWanted = Schemas["UserWanted"];

/** The server's side of a WebSocket (RFC 6455), as far as the page uses it: texts out, close and ping in. */
import { createHash } from "node:crypto";
import type { IncomingMessage } from "node:http";
import type { Duplex } from "node:stream";

const GUID = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
const TEXT = 0x81;
const CLOSE = 0x88;
const PONG = 0x8a;
/** The page sends close, ping and pong alone: 125 bytes at most, masked. */
const LONGEST_IN = 131;

export class Wire {
  isOpen = true;
  private unread: Buffer = Buffer.alloc(0);

  /** Answers the handshake. */
  constructor(
    request: IncomingMessage,
    private readonly stream: Duplex,
  ) {
    const key = request.headers["sec-websocket-key"] ?? "";
    const accept = createHash("sha1").update(key + GUID).digest("base64");
    const head = ["HTTP/1.1 101 Switching Protocols", "Upgrade: websocket", "Connection: Upgrade", `Sec-WebSocket-Accept: ${accept}`];
    stream.write(`${head.join("\r\n")}\r\n\r\n`);
    stream.on("data", (bytes: Buffer) => this.read(bytes));
    stream.on("error", () => this.end());
    stream.on("close", () => this.end());
  }

  /** Sends these texts, a message each. Returns whether the peer takes them as fast as they are sent. */
  send(texts: string[]): boolean {
    return !this.isOpen || this.stream.write(Buffer.concat(texts.map((text) => frame(TEXT, Buffer.from(text)))));
  }

  /** Whether all that was sent has left. */
  get isDrained(): boolean {
    return this.stream.writableLength === 0;
  }

  /** Waits until the peer has taken what was sent, or is gone. */
  async drained(): Promise<void> {
    while (this.isOpen && this.stream.writableNeedDrain) {
      await new Promise<void>((next) => {
        this.stream.once("drain", next);
        this.stream.once("close", next);
      });
    }
  }

  end(): void {
    this.isOpen = false;
    this.stream.destroy();
  }

  private read(bytes: Buffer): void {
    this.unread = Buffer.concat([this.unread, bytes]);
    while (this.unread.length >= 6) {
      const length = (this.unread[1] ?? 0) & 0x7f;
      const whole = 6 + length;
      if (whole > LONGEST_IN) return this.end();
      if (this.unread.length < whole) return;
      const kind = this.unread[0] ?? 0;
      const mask = this.unread.subarray(2, 6);
      const data = this.unread.subarray(6, whole).map((byte, at) => byte ^ (mask[at % 4] ?? 0));
      this.unread = this.unread.subarray(whole);
      if (kind === CLOSE) {
        this.stream.write(frame(CLOSE, Buffer.from(data)));
        return this.end();
      }
      if (kind === 0x89) this.stream.write(frame(PONG, Buffer.from(data)));
    }
  }
}

function frame(kind: number, data: Buffer): Buffer {
  const { length } = data;
  const head = Buffer.alloc(length < 126 ? 2 : length < 65_536 ? 4 : 10);
  head[0] = kind;
  if (length < 126) head[1] = length;
  else if (length < 65_536) {
    head[1] = 126;
    head.writeUInt16BE(length, 2);
  } else {
    head[1] = 127;
    head.writeBigUInt64BE(BigInt(length), 2);
  }
  return Buffer.concat([head, data]);
}

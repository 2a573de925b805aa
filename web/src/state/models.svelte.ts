/** The models of arms that the gateway knows. They stay the same for as long as the gateway runs. */
import { call } from "../api/client.ts";
import type { ArmModel, Models } from "../api/types.ts";

class ModelsState {
  /** `null` before they came. */
  all = $state.raw<ArmModel[] | null>(null);
  hasFailed = $state(false);
  #isAsking = false;

  /** Asks for them, unless they are known. */
  load(): void {
    if (this.all !== null || this.#isAsking) return;
    this.#isAsking = true;
    void call<Models>("GET", "/v1/models").then((answer) => {
      this.#isAsking = false;
      this.hasFailed = answer.kind !== "ok";
      if (answer.kind === "ok") this.all = answer.value.models;
    });
  }

  /** The model with this name, in upper or lower case. */
  named(name: string): ArmModel | undefined {
    return this.all?.find((model) => model.name.toLowerCase() === name.toLowerCase());
  }
}

export const models = new ModelsState();
